//! Reading configuration text: spans, collected mistakes, nearest names.
