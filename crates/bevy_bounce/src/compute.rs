//! Small helpers around compute passes.
