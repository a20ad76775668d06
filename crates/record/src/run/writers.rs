//! The files of a recording that are open: one, or one after the other where a file may not become too long.

use super::recorder::{RecorderError, RunFiles};
use super::series::{self, FILE_NUMBER};
use super::{ColumnWriter, McapRun, Rotation, RunEvent, RunSchema};
use crate::output::{WholeFile, create};
use std::collections::VecDeque;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

type Output = BufWriter<WholeFile>;

/// What is where, for whoever looks when the writers are gone.
#[derive(Debug, Default)]
pub(super) struct Kept {
    /// The MCAP file that was open last.
    pub(super) mcap: Option<PathBuf>,
    /// The column file that was open last.
    pub(super) columns: Option<PathBuf>,
    /// Cycles of each closed file that is kept, the oldest first.
    pub(super) closed: VecDeque<u64>,
    /// Cycles of files that made room for others.
    pub(super) removed: u64,
}

/// As writers and those who wait for them see it.
#[derive(Clone, Debug, Default)]
pub(super) struct KeptFiles(Arc<Mutex<Kept>>);

impl KeptFiles {
    pub(super) fn look(&self) -> MutexGuard<'_, Kept> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Open files.
pub(super) struct Writers {
    /// What they are told, with what became known meanwhile.
    files: RunFiles,
    schema: RunSchema,
    /// Keys that nothing needs any more, and from which time of the run on, ns.
    over: Vec<(String, u64)>,
    kept: KeptFiles,
    /// The number of the open files, from 1.
    number: u32,
    /// Cycles in the open files.
    cycles: u64,
    mcap: Option<(PathBuf, McapRun<Output>)>,
    columns: Option<(PathBuf, ColumnWriter<Output>)>,
}

impl Writers {
    /// Makes the files for rows of this schema.
    pub(super) fn create(files: RunFiles, schema: RunSchema, kept: KeptFiles) -> Result<Self, RecorderError> {
        if files.rotation.is_some() {
            for path in files.mcap.iter().chain(&files.columns) {
                series::remove_all(path).map_err(|source| of_file(path, source))?;
            }
        }
        let (mcap, columns) = (None, None);
        let mut writers =
            Writers { files, schema, over: Vec::new(), kept, number: 0, cycles: 0, mcap, columns };
        writers.open_next()?;
        Ok(writers)
    }

    pub(super) fn row(&mut self, time_ns: u64, row: &[u64]) -> Result<(), RecorderError> {
        let description = &mut self.files.description;
        self.over.retain(|(key, since_ns)| {
            let is_over = time_ns >= *since_ns;
            if is_over {
                description.remove(key);
            }
            !is_over
        });
        self.make_room(|writers| writers.length_with_row())?;
        if let Some((path, mcap)) = &mut self.mcap {
            mcap.write_row(time_ns, row)
                .map_err(|source| RecorderError::Mcap { path: path.clone(), source })?;
        }
        if let Some((path, columns)) = &mut self.columns {
            columns
                .write_row(time_ns, row)
                .map_err(|source| RecorderError::Columns { path: path.clone(), source })?;
        }
        self.cycles += 1;
        Ok(())
    }

    pub(super) fn describe(&mut self, key: &str, text: &str) -> Result<(), RecorderError> {
        self.make_room_for_words(key.len() + text.len())?;
        let Some((path, mcap)) = &mut self.mcap else { return Ok(()) };
        mcap.describe(key, text).map_err(|source| RecorderError::Mcap { path: path.clone(), source })?;
        // The files that follow say it too.
        self.files.description.insert(key.to_owned(), text.to_owned());
        Ok(())
    }

    /// Files that begin with a cycle from this time on don't say a key any more.
    pub(super) fn forget(&mut self, key: String, since_ns: u64) {
        self.over.push((key, since_ns));
    }

    pub(super) fn event(&mut self, event: &RunEvent) -> Result<(), RecorderError> {
        self.make_room_for_words(event.text.len())?;
        let Some((path, mcap)) = &mut self.mcap else { return Ok(()) };
        mcap.write_event(event).map_err(|source| RecorderError::Mcap { path: path.clone(), source })
    }

    pub(super) fn finish(mut self) -> Result<(), RecorderError> {
        self.close()
    }

    fn make_room_for_words(&mut self, bytes: usize) -> Result<(), RecorderError> {
        self.make_room(|writers| writers.mcap.as_ref().map_or(0, |(_, mcap)| mcap.length_with_words(bytes)))
    }

    /// Goes on in the next file where the open one would become too long.
    fn make_room(&mut self, length: impl Fn(&Writers) -> u64) -> Result<(), RecorderError> {
        if self.has_room(length(self)).is_ok() {
            return Ok(());
        }
        if let Some((path, mcap)) = &mut self.mcap {
            let compressed = mcap.compress();
            let compressed =
                compressed.map_err(|source| RecorderError::Mcap { path: path.clone(), source })?;
            if compressed && self.has_room(length(self)).is_ok() {
                return Ok(());
            }
        }
        if self.cycles == 0 {
            // A fresh file has no room either.
            return self.has_room(length(self));
        }
        self.close()?;
        self.open_next()
    }

    fn close(&mut self) -> Result<(), RecorderError> {
        if let Some((path, mcap)) = self.mcap.take() {
            let finished = mcap.finish().and_then(|output| Ok(ended(output)?));
            finished.map_err(|source| RecorderError::Mcap { path, source })?;
        }
        if let Some((path, columns)) = self.columns.take() {
            columns.finish().and_then(ended).map_err(|source| of_file(&path, source))?;
        }
        let mut kept = self.kept.look();
        kept.closed.push_back(std::mem::take(&mut self.cycles));
        (kept.mcap, kept.columns) = (None, None);
        Ok(())
    }

    fn open_next(&mut self) -> Result<(), RecorderError> {
        self.number += 1;
        self.remove_oldest()?;
        let number = self.number;
        let is_series = self.files.rotation.is_some();
        let name = |path: &PathBuf| if is_series { series::numbered(path, number) } else { path.clone() };
        let create = |path: &Path| {
            let file = create(path).map(|file| BufWriter::new(WholeFile::new(file)));
            file.map_err(|source| of_file(path, source))
        };
        if is_series {
            self.files.description.insert(FILE_NUMBER.to_owned(), number.to_string());
        }
        if let Some(path) = self.files.mcap.as_ref().map(name) {
            let output = create(&path)?;
            self.kept.look().mcap = Some(path.clone());
            let mcap = McapRun::create(output, &self.schema, &self.files.description)
                .map_err(|source| RecorderError::Mcap { path: path.clone(), source })?;
            self.mcap = Some((path, mcap));
        }
        if let Some(path) = self.files.columns.as_ref().map(name) {
            let output = create(&path)?;
            self.kept.look().columns = Some(path.clone());
            let columns =
                ColumnWriter::create(output, &self.schema).map_err(|source| of_file(&path, source))?;
            self.columns = Some((path, columns));
        }
        // Better known before anything moves.
        self.has_room(self.length_with_row())
    }

    /// Bytes of the longer one of the finished files, at most, where a row is written before.
    fn length_with_row(&self) -> u64 {
        let mcap = self.mcap.as_ref().map_or(0, |(_, mcap)| mcap.length_with_row());
        mcap.max(self.columns.as_ref().map_or(0, |(_, columns)| columns.length_with_row()))
    }

    fn has_room(&self, needed: u64) -> Result<(), RecorderError> {
        match self.files.rotation {
            Some(Rotation { file_bytes, .. }) if needed > file_bytes => {
                let path = self.files.mcap.clone().or_else(|| self.files.columns.clone()).unwrap_or_default();
                Err(RecorderError::TooShort { path, file_bytes, needed })
            }
            _ => Ok(()),
        }
    }

    /// Removes the files that make room for those that are opened next.
    fn remove_oldest(&mut self) -> Result<(), RecorderError> {
        let files = self.files.rotation.and_then(|rotation| rotation.files);
        let Some(oldest) =
            files.and_then(|files| self.number.checked_sub(files)).filter(|number| *number > 0)
        else {
            return Ok(());
        };
        for path in self.files.mcap.iter().chain(&self.files.columns) {
            let path = series::numbered(path, oldest);
            match std::fs::remove_file(&path) {
                // Somebody took it away: it takes no room either.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                removed => removed.map_err(|source| of_file(&path, source))?,
            }
        }
        let mut kept = self.kept.look();
        kept.removed += kept.closed.pop_front().unwrap_or_default();
        Ok(())
    }
}

fn of_file(path: &Path, source: io::Error) -> RecorderError {
    RecorderError::File { path: path.to_owned(), source }
}

/// Writes what is still held back, and looks whether all of the file is there.
fn ended(mut output: Output) -> io::Result<()> {
    output.flush()?;
    output.get_ref().check()
}
