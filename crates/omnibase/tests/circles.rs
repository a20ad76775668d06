//! Modules don't stand in circles: neither those of a crate nor those of a folder of it, a folder counted as one.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Modules that may use each other.
const MOST: usize = 3;

/// A module by its names from the root of its crate.
type Module = Vec<String>;

/// The sources of one crate, without comments and tests.
struct Sources {
    texts: BTreeMap<Module, Vec<String>>,
    /// What a module hands on under a name: the path.
    handed_on: BTreeMap<(Module, String), Module>,
}

impl Sources {
    fn of(source: &Path) -> Self {
        let mut sources = Sources { texts: BTreeMap::new(), handed_on: BTreeMap::new() };
        sources.read(source, &Vec::new());
        for (module, words) in sources.texts.clone() {
            for (path, is_public) in uses(&words) {
                let Some(name) = path.last().filter(|_| is_public) else { continue };
                sources.handed_on.insert((module.clone(), name.clone()), path.clone());
            }
        }
        sources
    }

    fn read(&mut self, folder: &Path, module: &Module) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
            let is_root = ["lib", "main", "mod"].contains(&name.as_str());
            let own =
                if is_root { module.clone() } else { [&module[..], std::slice::from_ref(&name)].concat() };
            if path.is_dir() {
                self.read(&path, &own);
            } else if path.extension().is_some_and(|end| end == "rs") && name != "tests" {
                self.texts.entry(own).or_default().extend(words(&fs::read_to_string(&path).unwrap()));
            }
        }
    }

    /// The module in which a path ends, followed to where the name is; `None` where it leaves the crate.
    fn resolve(&self, from: &Module, path: &[String], depth: u32) -> Option<Module> {
        let mut rest = path;
        let mut at = match rest.first()?.as_str() {
            "crate" => Vec::new(),
            "self" | "super" => from.clone(),
            name => {
                let child = [&from[..], &[name.to_owned()]].concat();
                return self
                    .texts
                    .contains_key(&child)
                    .then(|| self.resolve(from, &self_and(path), depth))?;
            }
        };
        while let Some(word) = rest.first().filter(|word| ["crate", "self", "super"].contains(&word.as_str()))
        {
            if word == "super" {
                at.pop();
            }
            rest = &rest[1..];
        }
        while let Some(name) = rest.first() {
            let child = [&at[..], std::slice::from_ref(name)].concat();
            if !self.texts.contains_key(&child) {
                break;
            }
            (at, rest) = (child, &rest[1..]);
        }
        let handed_on = rest.first().and_then(|name| self.handed_on.get(&(at.clone(), name.clone())));
        match handed_on.filter(|_| depth < 6) {
            Some(path) => self.resolve(&at, path, depth + 1).or(Some(at)),
            None => Some(at),
        }
    }

    /// Who uses whom among the modules right below each folder.
    fn siblings(&self) -> BTreeMap<Module, BTreeMap<String, BTreeSet<String>>> {
        let mut all: BTreeMap<Module, BTreeMap<String, BTreeSet<String>>> = BTreeMap::new();
        for (module, words) in &self.texts {
            let paths = uses(words).into_iter().map(|(path, _)| path).chain(inline(words));
            for used in paths.filter_map(|path| self.resolve(module, &path, 0)) {
                let same = module.iter().zip(&used).take_while(|(one, other)| one == other).count();
                if let (Some(one), Some(other)) = (module.get(same), used.get(same)) {
                    let folder = all.entry(module[..same].to_vec()).or_default();
                    folder.entry(one.clone()).or_default().insert(other.clone());
                }
            }
        }
        all
    }
}

fn self_and(path: &[String]) -> Vec<String> {
    [&["self".to_owned()], path].concat()
}

/// The words and signs of a source, without comments and what stands in a module of tests.
fn words(text: &str) -> Vec<String> {
    let text = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    let mut words: Vec<String> = Vec::new();
    for line in text.lines() {
        let line = line.split("//").next().unwrap_or_default();
        let mut is_open = false;
        for sign in line.chars() {
            let is_word = sign.is_alphanumeric() || sign == '_';
            match words.last_mut().filter(|_| is_open && is_word) {
                Some(word) => word.push(sign),
                None if !sign.is_whitespace() => words.push(sign.to_string()),
                None => {}
            }
            is_open = is_word;
        }
    }
    words
}

/// The paths of all `use`, each with whether it is handed on.
fn uses(words: &[String]) -> Vec<(Vec<String>, bool)> {
    let mut all = Vec::new();
    for at in (0..words.len()).filter(|at| words[*at] == "use") {
        let end = words[at..].iter().position(|word| word == ";").map_or(words.len(), |length| at + length);
        let before: Vec<&str> = words[at.saturating_sub(4)..at].iter().map(String::as_str).collect();
        let is_public = before.ends_with(&["pub"]) || before.ends_with(&[")"]) && before.contains(&"pub");
        let mut paths = Vec::new();
        tree(&words[at + 1..end], &mut 0, &mut Vec::new(), &mut paths);
        all.extend(paths.into_iter().map(|path| (path, is_public)));
    }
    all
}

/// The paths of a tree of names: `a::{b, c::d}`.
fn tree(words: &[String], at: &mut usize, path: &mut Vec<String>, all: &mut Vec<Vec<String>>) {
    let depth = path.len();
    let mut is_taken = false;
    while *at < words.len() {
        let word = &words[*at];
        *at += 1;
        match word.as_str() {
            ":" => {}
            "{" => {
                tree(words, at, path, all);
                is_taken = true;
            }
            "}" | "," => {
                if !is_taken && path.len() > depth {
                    all.push(path.clone());
                }
                path.truncate(depth);
                is_taken = false;
                if word == "}" {
                    return;
                }
            }
            "as" => *at += 1,
            word => path.push(word.to_owned()),
        }
    }
    if !is_taken && path.len() > depth {
        all.push(path.clone());
    }
    path.truncate(depth);
}

/// Paths that stand in the text: `crate::a::b`.
fn inline(words: &[String]) -> Vec<Vec<String>> {
    let mut all = Vec::new();
    for at in (0..words.len()).filter(|at| ["crate", "super", "self"].contains(&words[*at].as_str())) {
        let mut path = vec![words[at].clone()];
        let mut next = at + 1;
        while words.get(next..next + 2).is_some_and(|signs| signs == [":", ":"]) && next + 2 < words.len() {
            path.push(words[next + 2].clone());
            next += 3;
        }
        if path.len() > 1 {
            all.push(path);
        }
    }
    all
}

/// Who is reached from whom.
fn reached(from: &str, uses: &BTreeMap<String, BTreeSet<String>>) -> BTreeSet<String> {
    let (mut all, mut next) = (BTreeSet::new(), vec![from.to_owned()]);
    while let Some(one) = next.pop() {
        for other in uses.get(&one).into_iter().flatten() {
            if all.insert(other.clone()) {
                next.push(other.clone());
            }
        }
    }
    all
}

#[test]
fn modules_stand_in_no_circles() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let (mut looked_at, mut circles) = (0, Vec::new());
    for entry in fs::read_dir(crates).unwrap() {
        let source = entry.unwrap().path().join("src");
        if !source.is_dir() {
            continue;
        }
        for (folder, uses) in Sources::of(&source).siblings() {
            looked_at += uses.len();
            let reached: BTreeMap<&String, BTreeSet<String>> =
                uses.keys().map(|one| (one, reached(one, &uses))).collect();
            for (one, others) in &reached {
                let circle: BTreeSet<&String> = others
                    .iter()
                    .filter(|other| reached.get(other).is_some_and(|back| back.contains(*one)))
                    .collect();
                if circle.len() > MOST && circle.first() == Some(one) {
                    circles.push(format!("{} {}: {circle:?}", source.display(), folder.join("/")));
                }
            }
        }
    }
    assert!(looked_at > 300, "only {looked_at} modules use others: is the search broken?");
    assert!(circles.is_empty(), "more than {MOST} modules use each other:\n{}", circles.join("\n"));
}
