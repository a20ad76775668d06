//! A recorded run for viewers.

use anyhow::Context;
use omnibase_measure::events::is_stop;
use omnibase_record::run::{BEGUN, Due, RecordedRun, Selection};
use omnibase_record::viewer::{Channels, ViewerFile};
use omnibase_robot::Registry;
use omnibase_run::codes::named;
use omnibase_run::robot_text::from_description;
use omnibase_run::view::{DRAWN_EVERY_NS, View};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes it: signals as they were kept, the robot drawn thirty times a second, events as a log.
pub(super) fn write(
    run: &RecordedRun,
    path: &Path,
    registry: &Registry,
    output: &mut dyn Write,
) -> anyhow::Result<()> {
    let plan = from_description(&run.description, registry).map_err(|problems| {
        let words: Vec<String> = problems.iter().map(ToString::to_string).collect();
        anyhow::anyhow!("the recording's robot: {}", words.join("; "))
    })?;
    let mut view = View::new(&plan, &run.schema);
    let rows = || run.times_ns.iter().zip(run.values.chunks_exact(run.schema.width().max(1)));
    let wished: Vec<[f64; 2]> = rows().filter_map(|(_, row)| view.wished_m(row)).collect();
    view.set_path(wished.into_iter());
    let file = File::create(path).with_context(|| format!("writing `{}`", path.display()))?;
    let begun_unix_ns = run.description.get(BEGUN).and_then(|ns| ns.parse().ok()).unwrap_or(0);
    let channels = Channels::new(&run.schema, &named(&plan));
    let mut file = ViewerFile::create(BufWriter::new(file), channels, begun_unix_ns, &run.description)?;
    let mut due = Due::new(&Selection { signals: Vec::new(), every_ns: Some(DRAWN_EVERY_NS) });
    let (mut events, mut drawings) = (run.events.iter().peekable(), 0);
    for (time_ns, row) in rows() {
        while let Some(event) = events.next_if(|event| event.time_ns <= *time_ns) {
            file.write_event(event, is_stop(&event.text))?;
        }
        view.hear(*time_ns, row);
        file.write_row(*time_ns, row)?;
        if due.take(*time_ns) {
            file.write_drawing(*time_ns, &view.draw(*time_ns, row))?;
            drawings += 1;
        }
    }
    for event in events {
        file.write_event(event, false)?;
    }
    file.finish()?;
    let (rows, signals) = (run.times_ns.len(), run.schema.width());
    writeln!(output, "{}: {rows} rows of {signals} signals, {drawings} drawings", path.display())?;
    Ok(())
}
