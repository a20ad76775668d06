//! The program without stages of anybody's own.
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    omnibase::cli(|_| {})
}
