use super::{Cli, Command, joined};
use omnibase_robot::Registry;
use std::path::{Path, PathBuf};

fn documents() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut found = vec![root.join("README.md"), root.join("CONTRIBUTING.md")];
    let mut folders = vec![root.join("docs")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.extension() {
                Some(extension) if extension == "md" => found.push(path),
                _ if path.is_dir() => folders.push(path),
                _ => {}
            }
        }
    }
    found
}

/// The command lines of omnibase in a document: in blocks of shell, and in the first column of tables.
fn command_lines(text: &str) -> Vec<String> {
    let blocks = text.split("```sh").skip(1).filter_map(|rest| rest.split("```").next());
    let lines = blocks.flat_map(|block| block.lines().skip(1)).map(str::to_owned);
    let table = text.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
    // A word that stands for a word doesn't redirect.
    let table = table.map(|line| line.replace(['<', '>'], "_").replace("[", "").replace("]", ""));
    let starts = ["cargo run --release -- ", "target/release/omnibase ", "omnibase "];
    let of = |line: String| {
        let line = line.split(" # ").next()?.trim_end_matches(" &").trim().to_owned();
        starts.iter().find_map(|start| line.strip_prefix(start)).map(str::to_owned)
    };
    lines.chain(table).filter_map(of).collect()
}

/// A line's words as a shell takes them, without anything but quotes.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for letter in line.chars() {
        match (quote, letter) {
            (None, '"' | '\'') => {
                quote = Some(letter);
                word.get_or_insert_default();
            }
            (Some(open), _) if open == letter => quote = None,
            (None, _) if letter.is_whitespace() => words.extend(word.take()),
            _ => word.get_or_insert_default().push(letter),
        }
    }
    words.extend(word);
    words
}

#[test]
fn every_command_line_in_the_documents_is_one_that_the_program_takes() {
    let mut checked = 0;
    for document in documents() {
        // A line that ends in a backslash goes on.
        let text = std::fs::read_to_string(&document).unwrap().replace("\\\n", " ");
        for line in command_lines(&text) {
            if line.starts_with("_command_ ") || line.starts_with("<command> ") {
                continue;
            }
            let arguments = std::iter::once("omnibase".to_owned()).chain(words(&line));
            let command = Cli::command_with(&Registry::with_built_in());
            let read = command
                .try_get_matches_from(joined(arguments.map(Into::into)))
                .and_then(|matches| Cli::from_matches(&matches));
            if let Err(error) = read {
                panic!("{}: omnibase {line}\n{error}", document.display());
            }
            checked += 1;
        }
    }
    assert!(checked > 40, "only {checked} command lines were found: is the search broken?");
}

#[test]
fn the_command_line_is_sound() {
    Cli::command_with(&Registry::with_built_in()).debug_assert();
}

#[test]
fn a_measured_pose_follows_its_option_with_or_without_a_sign_of_equality_or_not_at_all() {
    let measured = |line: &[&str]| {
        let all = ["omnibase", "run", "bmm.toml"].iter().chain(line).map(|word| (*word).into());
        let matches = Cli::command_with(&Registry::with_built_in()).try_get_matches_from(joined(all));
        let Command::Run(arguments) = Cli::from_matches(&matches.unwrap()).unwrap().command else { panic!() };
        format!("{arguments:?}")
            .split("measured: ")
            .nth(1)
            .unwrap()
            .split(", json")
            .next()
            .unwrap()
            .to_owned()
    };
    let pose = measured(&["--measured=-0.002 0.001 0.5"]);
    assert!(pose.contains("x_m: -0.002"), "{pose}");
    assert_eq!(measured(&["--measured", "-0.002 0.001 0.5", "--json"]), pose);
    assert_eq!(measured(&["--measured", "--json"]), "Some(None)");
    assert_eq!(measured(&["--json"]), "None");
}
