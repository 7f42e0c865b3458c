//! The bus traits, and one room per bus.
