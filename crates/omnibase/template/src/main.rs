//! omnibase with the stages of this crate: all its commands and options.
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    omnibase::cli(CRATE::register)
}
