//! The program as its users meet it: arguments in, files and exit codes out.
//!
//! All tests share one binary, since linking takes longer than most of them.

mod determinism;
mod errors;
mod misuse;
mod pipeline;
mod support;
