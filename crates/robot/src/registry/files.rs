//! Keys of a reference that name files: which they are, and what the files give.

use serde_json::Value;

use super::{Key, Kind, Registry};
use crate::config::ReferenceTable;

/// What a file gives whose name is the value of a reference's key.
#[derive(Clone, Copy, Debug)]
pub struct FileContent {
    /// The key in whose place it stands, of the same table.
    pub instead_of: &'static str,
    /// Puts what its text gives into the reference's table.
    pub read: ReadContent,
}

/// Puts what a text gives into a reference's table; why it can't, in words.
pub type ReadContent = fn(&str, &mut ReferenceTable) -> Result<(), String>;

impl Key {
    /// The name of a file in place of another key of the same table; of a reference. The file is read with the robot's
    /// file, and recordings hold it.
    #[must_use]
    pub fn file(self, instead_of: &'static str, read: ReadContent) -> Self {
        Key { file: Some(FileContent { instead_of, read }), ..self }
    }
}

impl Kind {
    /// The keys that name files.
    pub fn files(&self) -> impl Iterator<Item = (&Key, &FileContent)> {
        self.keys.iter().filter_map(|key| Some((key, key.file.as_ref()?)))
    }
}

impl Registry {
    /// A reference's table with the name of each file changed; `None` takes the key away.
    pub fn with_files(
        &self,
        table: ReferenceTable,
        change: impl Fn(&str) -> Option<String>,
    ) -> ReferenceTable {
        let Ok((kind, _)) = self.references.find(table.kind.as_deref()) else { return table };
        let Ok(mut value) = serde_json::to_value(&table) else { return table };
        for (key, _) in kind.files() {
            let keys = if key.custom.is_some() { value.get_mut("custom") } else { Some(&mut value) };
            let Some(keys) = keys.and_then(Value::as_object_mut) else { continue };
            let Some(name) = keys.get(key.name).and_then(Value::as_str) else { continue };
            match change(name) {
                Some(name) => keys.insert(key.name.to_owned(), name.into()),
                None => keys.remove(key.name),
            };
        }
        serde_json::from_value(value).unwrap_or(table)
    }
}
