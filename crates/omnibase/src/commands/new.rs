//! `omnibase new`: a crate with stages of one's own, which runs at once.

use crate::Outcome;
use anyhow::{Context, ensure};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Where this program was built from.
const SOURCE: &str = env!("CARGO_MANIFEST_DIR");

/// What is written, where; `NAME`, `CRATE` and `OMNIBASE` stand for what differs.
const FILES: [(&str, &str); 7] = [
    ("Cargo.toml", include_str!("../../template/Cargo.toml.txt")),
    ("robot.toml", include_str!("../../template/robot.toml")),
    ("src/lib.rs", include_str!("../../template/src/lib.rs")),
    ("src/main.rs", include_str!("../../template/src/main.rs")),
    ("tests/robot.rs", include_str!("../../template/tests/robot.rs")),
    ("src/controller.rs", include_str!("../../template/src/controller.rs")),
    ("src/estimator.rs", include_str!("../../template/src/estimator.rs")),
];

/// Makes a crate of one's own: a robot's file, a controller, an estimator and a test, which run at once.
///
/// The crate's program is omnibase with these stages: every command and every option works with them.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  omnibase new my-robot && cd my-robot
  cargo run -- run robot.toml --dashboard
  cargo test")]
pub struct Arguments {
    /// The crate's name, and its folder's; a path makes it there.
    name: PathBuf,
    /// Where omnibase is: a folder with its source, or the URL of a git repository. Otherwise the folder from which this
    /// program was built.
    #[arg(long, value_name = "FOLDER or URL")]
    omnibase: Option<String>,
}

/// Runs the command.
pub fn run(arguments: &Arguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let folder = &arguments.name;
    let name = folder.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let is_word = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    ensure!(
        name.starts_with(|c: char| c.is_ascii_lowercase()) && name.chars().all(is_word) && name != "omnibase",
        "`{}` is no name for a crate of your own: expected a small letter, then small letters, digits, - and _",
        folder.display()
    );
    let omnibase = dependency(arguments.omnibase.as_deref())?;
    // Nothing of anybody's is overwritten.
    fs::create_dir(folder).with_context(|| format!("making the folder `{}`", folder.display()))?;
    let krate = name.replace('-', "_");
    for (path, text) in FILES {
        let text = text.replace("NAME", name).replace("CRATE", &krate).replace("OMNIBASE", &omnibase);
        let path = folder.join(path);
        let made = path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(&path, text));
        made.with_context(|| format!("writing `{}`", path.display()))?;
    }
    writeln!(output, "{}: {} files", folder.display(), FILES.len())?;
    writeln!(output, "\n  cd {}\n  cargo run -- run robot.toml\n  cargo test", folder.display())?;
    Ok(Outcome::Done)
}

/// What `Cargo.toml` says of omnibase.
fn dependency(given: Option<&str>) -> anyhow::Result<String> {
    let quoted = |text: &str| toml::Value::from(text).to_string();
    if let Some(url) = given.filter(|given| given.contains("://")) {
        return Ok(format!("{{ git = {} }}", quoted(url)));
    }
    let folder = Path::new(given.unwrap_or(SOURCE));
    let roots = [folder.to_owned(), folder.join("crates/omnibase")];
    let found = roots.iter().find(|root| root.join("src/prelude.rs").is_file()).with_context(|| {
        format!(
            "no source of omnibase in `{}`: name its folder, or a repository, by --omnibase",
            folder.display()
        )
    })?;
    let found = fs::canonicalize(found).with_context(|| format!("`{}`", found.display()))?;
    Ok(format!("{{ path = {} }}", quoted(&found.to_string_lossy())))
}
