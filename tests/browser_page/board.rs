//! The patch bay as a tool: boxes, matrix, history.
