//! The files that recordings go into.

use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::Path;

/// Makes a file, or empties the one that is there.
///
/// A pipe counts where somebody reads it. What else isn't a regular file is refused: a pipe that nobody reads would wait
/// for ever, and a device keeps nothing.
pub fn create(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    // Without O_NONBLOCK the opening of a pipe waits for its reader.
    let opened = options.write(true).create(true).truncate(false).custom_flags(libc::O_NONBLOCK).open(path);
    let file = match opened {
        Err(error) if error.raw_os_error() == Some(libc::ENXIO) => return Err(refused("a pipe or socket")),
        opened => opened?,
    };
    let kind = file.metadata()?.file_type();
    if kind.is_fifo() {
        // Its reader is there: from here on what is written waits for it.
        rustix::fs::fcntl_setfl(&file, rustix::fs::OFlags::WRONLY)?;
        return Ok(file);
    }
    if !kind.is_file() {
        return Err(refused(match kind {
            kind if kind.is_char_device() || kind.is_block_device() => "a device",
            _ => "something else",
        }));
    }
    file.set_len(0)?;
    Ok(file)
}

fn refused(found: &str) -> io::Error {
    let text = format!("expected a regular file, which can be read again, found {found}");
    io::Error::new(io::ErrorKind::InvalidInput, text)
}

/// A file that notices when somebody else cuts it off or removes it: what is written then could not be read again.
pub(crate) struct WholeFile {
    file: File,
    position: u64,
    /// As long as the file is by what was written.
    end: u64,
}

impl WholeFile {
    /// An empty file, as [`create`] makes it.
    pub(crate) fn new(file: File) -> Self {
        WholeFile { file, position: 0, end: 0 }
    }

    /// An error where the file isn't any more what was written.
    pub(crate) fn check(&self) -> io::Result<()> {
        let there = self.file.metadata()?;
        if there.file_type().is_fifo() {
            return Ok(());
        }
        if there.nlink() == 0 {
            return Err(io::Error::other("the file was removed while it was written"));
        }
        if there.len() < self.end {
            let text =
                format!("the file was cut off at {} of {} bytes while it was written", there.len(), self.end);
            return Err(io::Error::other(text));
        }
        Ok(())
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.check()?;
        let written = self.file.write(bytes)?;
        self.position += written as u64;
        self.end = self.end.max(self.position);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for WholeFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.position = self.file.seek(to)?;
        Ok(self.position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    fn folder(name: &str) -> std::path::PathBuf {
        let folder = std::env::temp_dir().join(format!("omnibase-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn only_regular_files_and_pipes_with_a_reader_are_written_and_nothing_waits() {
        let folder = folder("output");
        let pipe = folder.join("pipe");
        assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let refusal = create(&pipe).unwrap_err();
        assert!(refusal.to_string().contains("expected a regular file"), "{refusal}");
        // With a reader it counts.
        let mut reader = OpenOptions::new().read(true).custom_flags(libc::O_NONBLOCK).open(&pipe).unwrap();
        let mut written = WholeFile::new(create(&pipe).unwrap());
        written.write_all(b"read").unwrap();
        written.check().unwrap();
        drop(written);
        let mut text = String::new();
        std::io::Read::read_to_string(&mut reader, &mut text).unwrap();
        assert_eq!(text, "read");
        assert!(create(Path::new("/dev/null")).unwrap_err().to_string().ends_with("found a device"));
        // What was there is gone.
        let file = folder.join("file");
        std::fs::write(&file, "before").unwrap();
        drop(create(&file).unwrap());
        assert_eq!(std::fs::read(&file).unwrap(), b"");
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_file_that_is_cut_off_or_removed_is_written_no_further() {
        let folder = folder("whole");
        let path = folder.join("file");
        let mut file = WholeFile::new(create(&path).unwrap());
        file.write_all(&[1; 100]).unwrap();
        // Over what was written, and back to its end.
        file.seek(SeekFrom::Start(10)).unwrap();
        file.write_all(&[2; 10]).unwrap();
        file.seek(SeekFrom::End(0)).unwrap();
        file.write_all(&[3; 10]).unwrap();
        OpenOptions::new().write(true).open(&path).unwrap().set_len(50).unwrap();
        let refusal = file.write_all(&[4; 10]).unwrap_err();
        assert_eq!(refusal.to_string(), "the file was cut off at 50 of 110 bytes while it was written");
        let mut file = WholeFile::new(create(&path).unwrap());
        file.write_all(&[1; 100]).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert!(file.check().unwrap_err().to_string().contains("was removed"));
        std::fs::remove_dir_all(folder).unwrap();
    }
}
