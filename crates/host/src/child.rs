//! Programs that are started by this one and don't outlive it.

use std::io;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// The kernel kills the program where the thread that starts it ends, however that comes: so start it from one that lasts.
pub fn ends_with_this(command: &mut Command) -> &mut Command {
    let parent = std::process::id();
    let before = move || {
        rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL))?;
        // The parent may have ended before that was asked for.
        let now = rustix::process::getppid().map(|pid| pid.as_raw_nonzero().get());
        if now == i32::try_from(parent).ok() { Ok(()) } else { Err(io::ErrorKind::BrokenPipe.into()) }
    };
    // SAFETY: between fork and exec the closure calls prctl and getppid alone: it takes no lock, and allocates nothing unless it
    // fails with a plain kind of error, which doesn't either.
    unsafe { command.pre_exec(before) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader, Read};
    use std::process::Stdio;

    #[test]
    fn a_program_ends_with_the_thread_that_started_it() {
        let (mut child, mut output) = std::thread::spawn(|| {
            let mut command = Command::new("sh");
            command.args(["-c", "echo there; exec sleep 1000"]).stdout(Stdio::piped());
            let mut child = ends_with_this(&mut command).spawn().unwrap();
            let mut output = BufReader::new(child.stdout.take().unwrap());
            let mut line = String::new();
            output.read_line(&mut line).unwrap();
            assert_eq!(line, "there\n");
            (child, output)
        })
        .join()
        .unwrap();
        // The end of its output is its own end.
        let mut rest = String::new();
        output.read_to_string(&mut rest).unwrap();
        assert_eq!(rest, "");
        assert!(!child.wait().unwrap().success());
    }
}
