//! Tables whose rows are driven on all cores.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Prints the row of each case, in their order: one as soon as it and those before it are there.
///
/// # Panics
/// Where a row does.
pub fn print_in_order<C: Sync>(cases: &[C], row: impl Fn(&C) -> String + Sync) {
    let next = AtomicUsize::new(0);
    let rows: Mutex<(usize, Vec<Option<String>>)> = Mutex::new((0, vec![None; cases.len()]));
    let work = || {
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(case) = cases.get(at) else { return };
            let text = row(case);
            let (printed, rows) = &mut *rows.lock().expect("rows");
            rows[at] = Some(text);
            while let Some(row) = rows.get_mut(*printed).and_then(Option::take) {
                println!("{row}");
                *printed += 1;
            }
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| (0..threads).for_each(|_| drop(scope.spawn(work))));
}
