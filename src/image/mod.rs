//! The process image: wait-free hand-over, edge counters, age, event ring.
