//! What the documents name exists: files, folders, and decisions in their order.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn documents() -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> =
        ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"].iter().map(|name| root().join(name)).collect();
    let mut folders = vec![root().join("docs")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                found.push(path);
            }
        }
    }
    found
}

/// All files of a folder and of the folders in it.
fn files_below(folder: PathBuf) -> Vec<PathBuf> {
    let (mut files, mut paths) = (Vec::new(), vec![folder]);
    while let Some(path) = paths.pop() {
        if path.is_dir() {
            paths.extend(fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()));
        } else {
            files.push(path);
        }
    }
    files
}

/// Paths of the repository that a text names in backticks or as the target of a link.
fn named_paths(text: &str) -> Vec<String> {
    let folders = ["crates/", "docs/", "segments/", "robots/", "fuzz/", "examples/", ".ci/"];
    let in_backticks = text.split('`').skip(1).step_by(2).filter(|name| {
        folders.iter().any(|folder| name.starts_with(folder)) && !name.contains([' ', '*', '<', '\n'])
    });
    let in_links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let in_links = in_links.filter(|target| !target.contains("://") && !target.starts_with('#'));
    in_backticks.chain(in_links).map(|name| name.split('#').next().unwrap_or(name).to_owned()).collect()
}

#[test]
fn every_path_that_a_document_names_exists() {
    let mut checked = 0;
    for document in documents() {
        let text = fs::read_to_string(&document).unwrap();
        for name in named_paths(&text) {
            let beside = document.parent().unwrap().join(&name);
            assert!(
                root().join(&name).exists() || beside.exists(),
                "{} names {name}, which does not exist",
                document.display()
            );
            checked += 1;
        }
    }
    assert!(checked > 10, "only {checked} paths were found in the documents: is the search broken?");
}

/// Whether these sources have an example in Rust in the comments of which documentation is made.
fn has_example(folder: &Path) -> bool {
    fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).any(|path| {
        if path.is_dir() {
            return has_example(&path);
        }
        let text = fs::read_to_string(&path).unwrap_or_default();
        let lines = text.lines().map(str::trim_start);
        let comments = lines.filter_map(|line| line.strip_prefix("///").or(line.strip_prefix("//!")));
        let fences = comments.filter_map(|line| line.trim_start().strip_prefix("```"));
        fences.step_by(2).any(|language| !["text", "toml"].contains(&language))
    })
}

#[test]
fn examples_in_comments_are_tested_where_there_are_any() {
    let folders = ["crates", "examples"].map(|name| fs::read_dir(root().join(name)).unwrap());
    let mut with = Vec::new();
    for package in folders.into_iter().flatten().map(|entry| entry.unwrap().path()) {
        if !package.join("src/lib.rs").is_file() {
            continue;
        }
        // Where there are none, rustdoc would read the whole crate for nothing.
        let is_tested =
            !fs::read_to_string(package.join("Cargo.toml")).unwrap().contains("\ndoctest = false\n");
        assert_eq!(is_tested, has_example(&package.join("src")), "doctest of {}", package.display());
        with.extend(is_tested.then(|| package.file_name().unwrap().to_owned()));
    }
    assert!(with.contains(&"client".into()), "{with:?}");
}

/// The test functions and modules of a target, as the table of standards names it.
fn tests_of(target: &str) -> Option<String> {
    let place = match target {
        "live" | "bus" => format!("crates/run/tests/{target}"),
        "cycle" => "crates/robot/tests/cycle".to_owned(),
        "dashboard" | "real_time" => format!("crates/omnibase/tests/{target}"),
        "pages" => "crates/dashboard/tests".to_owned(),
        "trials" => "crates/trials/tests".to_owned(),
        _ => return None,
    };
    Some(files_below(root().join(place)).into_iter().map(|path| fs::read_to_string(path).unwrap()).collect())
}

#[test]
fn every_test_that_the_table_of_standards_names_exists() {
    let document = fs::read_to_string(root().join("docs/safety.md")).unwrap();
    let table = document.split("## Against the standards").nth(1).unwrap();
    let mut checked = 0;
    for named in table.split('`').skip(1).step_by(2) {
        let Some((target, name)) = named.split_once(' ') else { continue };
        if ["cargo", "omnibase", "--test"].contains(&target) || name.starts_with('=') {
            continue;
        }
        let tests =
            tests_of(target).unwrap_or_else(|| panic!("docs/safety.md names {named}: no target {target}"));
        let exists = [format!("#[test]\nfn {name}("), format!("mod {name};")]
            .iter()
            .any(|found| tests.contains(found));
        assert!(exists, "docs/safety.md names {target} {name}, which does not exist");
        checked += 1;
    }
    assert!(checked > 20, "only {checked} tests were found in the table: is the search broken?");
}

/// Commands in blocks that begin with "```sh tested": each one `cargo run --release -- ...` on simulated segments.
#[test]
fn every_command_that_a_document_marks_as_tested_works() {
    let mut checked = 0;
    for document in documents() {
        let text = fs::read_to_string(&document).unwrap();
        let blocks = text.split("```sh tested\n").skip(1).filter_map(|rest| rest.split("```").next());
        for line in blocks.flat_map(str::lines) {
            let arguments = line.strip_prefix("cargo run --release -- ").expect("a command of omnibase");
            let arguments = words(arguments.split(" # ").next().unwrap_or_default());
            let command =
                Command::new(env!("CARGO_BIN_EXE_omnibase")).args(arguments).current_dir(root()).output();
            let output = command.unwrap();
            let says = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{}: {line}: {says}", document.display());
            // What the document shows of the output, line by line, in the block of text that follows.
            let shown = text.split(line).nth(1).and_then(|rest| rest.split("```text\n").nth(1));
            let printed = String::from_utf8_lossy(&output.stdout);
            for shown in shown.and_then(|rest| rest.split("```").next()).into_iter().flat_map(str::lines) {
                assert!(printed.contains(shown), "{}: {line} doesn't print: {shown}", document.display());
            }
            checked += 1;
        }
    }
    assert!(checked > 0, "no command was found in the documents: is the search broken?");
}

#[test]
fn every_document_gives_the_program_the_same_rights() {
    let mut lines = 0;
    for document in documents() {
        let text = fs::read_to_string(&document).unwrap();
        for line in text.lines().filter(|line| line.contains("setcap cap_")) {
            assert!(
                line.contains("setcap cap_net_raw,cap_sys_nice,cap_ipc_lock=ep "),
                "{}: {line}",
                document.display()
            );
            lines += 1;
        }
    }
    assert!(lines > 2, "{lines}: is the search broken?");
}

/// A line's words as a shell takes them, without anything but double quotes.
fn words(line: &str) -> Vec<String> {
    let quoted = line.split('"').enumerate();
    let words = quoted.flat_map(|(part, text)| match part % 2 {
        0 => text.split_whitespace().map(str::to_owned).collect(),
        _ => vec![text.to_owned()],
    });
    words.collect()
}

#[test]
fn every_crate_stands_in_the_code_map() {
    let map = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    for folder in ["crates", "examples"] {
        for entry in fs::read_dir(root().join(folder)).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            assert!(map.contains(&format!("`{folder}/{name}`")), "ARCHITECTURE.md lacks {folder}/{name}");
        }
    }
}

/// What the code map names below a crate's `src`, each name with its crate: a file without a path stands in the crate that
/// was named last.
fn named_in_the_map(map: &str) -> Vec<(&str, &str)> {
    let (mut named, mut last) = (Vec::new(), "");
    for name in map.split('`').skip(1).step_by(2) {
        if let Some(path) = name.strip_prefix("crates/") {
            let (of, below) = path.split_once('/').unwrap_or((path, ""));
            named.extend(below.strip_prefix("src/").map(|below| (of, below)));
            last = of;
        } else if name.ends_with(".rs") && !root().join(name).exists() {
            named.push((last, name));
        }
    }
    named
}

#[test]
fn every_module_stands_in_the_code_map_under_its_crate() {
    let map = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let named = named_in_the_map(&map);
    let mut checked = 0;
    for entry in fs::read_dir(root().join("crates")).unwrap() {
        let path = entry.unwrap().path();
        let of = path.file_name().unwrap().to_str().unwrap();
        for entry in fs::read_dir(path.join("src")).unwrap() {
            let file = entry.unwrap().path();
            let module = file.file_stem().unwrap().to_str().unwrap();
            if ["lib", "main", "tests"].contains(&module) {
                continue;
            }
            let is_named = named.iter().any(|&(its, name)| {
                let top = name.split('/').next().unwrap_or(name);
                its == of && top.strip_suffix(".rs").unwrap_or(top) == module
            });
            assert!(is_named, "ARCHITECTURE.md lacks {module} of crates/{of}/src");
            checked += 1;
        }
    }
    assert!(checked > 300, "only {checked} modules were found: is the search broken?");
}

#[test]
fn every_file_that_the_code_map_names_exists() {
    let map = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    for (of, name) in named_in_the_map(&map) {
        let src = root().join("crates").join(of).join("src");
        let exists = src.join(name).exists() || files_below(src).iter().any(|file| file.ends_with(name));
        assert!(exists, "ARCHITECTURE.md names {name} in crates/{of}/src, which does not exist");
    }
}

#[test]
fn unsafe_code_is_forbidden_everywhere_but_in_host() {
    for entry in fs::read_dir(root().join("crates")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        let lib = ["src/lib.rs", "src/main.rs"].iter().map(|file| path.join(file)).find(|file| file.exists());
        let text = fs::read_to_string(lib.unwrap()).unwrap();
        assert!(
            name == "host" || text.contains("#![forbid(unsafe_code)]"),
            "{name} does not forbid unsafe code"
        );
    }
}
