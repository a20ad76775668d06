//! omnibase with the stages of this crate: `own-stages run robot.toml`, and every other command.
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    omnibase::cli(own_stages::register)
}
