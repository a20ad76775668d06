//! Where the secret of those who may command comes from: never from the command line, which everybody on this computer
//! sees in the list of processes.

use anyhow::Context;
use std::convert::Infallible;
use std::fs;
use std::io::Read;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// The environment variable that holds it; others' are seen by nobody but root.
pub const VARIABLE: &str = "OMNIBASE_TOKEN";
/// Fewer bytes are guessed.
const LEAST: usize = 16;
/// No token is longer, bytes.
const MOST: u64 = 4096;

/// The token of a file, or of the environment; `None` where neither says one.
pub fn given(file: Option<&Path>) -> anyhow::Result<Option<String>> {
    match file {
        Some(path) => of_file(path).map(Some),
        None => match std::env::var(VARIABLE) {
            Ok(text) => {
                checked(text.trim()).with_context(|| format!("environment variable {VARIABLE}")).map(Some)
            }
            Err(_) => Ok(None),
        },
    }
}

fn of_file(path: &Path) -> anyhow::Result<String> {
    let name = path.display();
    let file = fs::File::open(path).with_context(|| format!("{name}"))?;
    let about = file.metadata().with_context(|| format!("{name}"))?;
    anyhow::ensure!(about.is_file(), "{name}: expected a file");
    anyhow::ensure!(
        about.mode() & 0o077 == 0,
        "{name}: others may read it: expected mode 0600, found {:04o}",
        about.mode() & 0o7777
    );
    let mut text = String::new();
    file.take(MOST).read_to_string(&mut text).with_context(|| format!("{name}"))?;
    checked(text.trim()).with_context(|| format!("{name}"))
}

fn checked(text: &str) -> anyhow::Result<String> {
    let plain = text.bytes().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_'));
    anyhow::ensure!(text.len() >= LEAST && plain, "expected at least {LEAST} letters, digits, - and _");
    Ok(text.to_owned())
}

/// What `--token TOKEN` says.
pub fn refused(_: &str) -> Result<Infallible, String> {
    Err(format!(
        "everybody on this computer would see it in the list of processes: expected it in the environment variable \
         {VARIABLE}, or in a file of mode 0600, --token-file FILE"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_file_that_others_may_read_or_that_holds_no_secret_is_refused_in_words() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        for (text, mode, expected) in [
            ("a-secret-of-this-test\n", 0o600, None),
            ("a-secret-of-this-test", 0o640, Some("others may read it: expected mode 0600, found 0640")),
            ("short", 0o600, Some("expected at least 16 letters")),
            ("two words that are long", 0o600, Some("expected at least 16 letters")),
        ] {
            fs::write(&path, text).unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
            let given = given(Some(&path));
            match expected {
                None => assert_eq!(given.unwrap().as_deref(), Some("a-secret-of-this-test")),
                Some(why) => {
                    let error = format!("{:#}", given.unwrap_err());
                    assert!(error.contains(why) && error.contains("token"), "{error}");
                }
            }
        }
    }
}
