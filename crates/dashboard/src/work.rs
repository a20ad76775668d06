//! Where everything is computed that takes more than a moment: beside the thread that hears stops, and gentler.

use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};

use tokio::runtime::{Handle, Runtime};
use tokio::sync::Semaphore;
use tokio::task::JoinHandle;

/// Computations of those who have the token, and of those who only look, at the same time.
const OF_COMMANDERS: usize = 2;
const OF_READERS: usize = 2;
/// Whoever looks after what the robot is doing waits for nobody.
const OF_DRIVES: usize = 1;
/// The longest wait for one to begin.
const LONGEST_WAIT: Duration = Duration::from_secs(2);
/// How much gentler than the thread that hears stops: it comes first wherever both could run.
const NICE: i32 = 10;

/// Who wants something computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum For {
    /// Somebody with the token.
    Commander,
    /// Somebody who only looks.
    Reader,
    /// What looks after a way that is under way.
    Drive,
}

/// Whether somebody still waits for what is computed.
#[derive(Clone, Debug)]
pub(crate) struct Waiting {
    whom: Option<Weak<()>>,
    since: Instant,
}

impl Waiting {
    /// As long as this is there.
    pub(crate) fn of(whom: &Arc<()>) -> Self {
        Waiting { whom: Some(Arc::downgrade(whom)), since: Instant::now() }
    }

    /// The same, since then.
    #[cfg(test)]
    pub(crate) fn since(whom: &Arc<()>, since: Instant) -> Self {
        Waiting { since, ..Waiting::of(whom) }
    }

    /// Nobody waits: what is done at once, or looks after itself.
    pub(crate) fn here() -> Self {
        Waiting { whom: None, since: Instant::now() }
    }

    /// Nobody waits any more.
    pub(crate) fn is_over(&self) -> bool {
        self.whom.as_ref().is_some_and(|whom| whom.strong_count() == 0)
    }

    /// Whether somebody has been waiting for longer than that, for a place to compute, too.
    pub(crate) fn is_longer_than(&self, longest: Duration) -> bool {
        self.whom.is_some() && self.since.elapsed() > longest
    }
}

/// Why something isn't computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum NotComputed {
    #[error("other paths are being computed: ask again when they are done")]
    Others,
    #[error("computing it failed: that is a fault of this program, told where it was started")]
    Failed,
}

/// The threads that compute.
#[derive(Clone)]
pub(crate) struct Work {
    handle: Handle,
    commanders: Arc<Semaphore>,
    readers: Arc<Semaphore>,
    drives: Arc<Semaphore>,
}

/// The runtime of all that isn't a request: what computes, and what is told to all.
pub(crate) fn runtime() -> std::io::Result<Runtime> {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .max_blocking_threads(OF_COMMANDERS + OF_READERS + OF_DRIVES)
        .thread_name("dashboard-work")
        .on_thread_start(|| {
            // Where that isn't allowed it goes on as it is.
            let _ = rustix::process::nice(NICE);
        })
        .enable_all()
        .build()
}

impl Work {
    pub(crate) fn new(handle: Handle) -> Self {
        let places = |count| Arc::new(Semaphore::new(count));
        let [commanders, readers, drives] = [OF_COMMANDERS, OF_READERS, OF_DRIVES].map(places);
        Work { handle, commanders, readers, drives }
    }

    /// Goes on beside the requests for good.
    pub(crate) fn spawn(&self, task: impl Future<Output = ()> + Send + 'static) -> JoinHandle<()> {
        self.handle.spawn(task)
    }

    /// Computes something elsewhere; refused where too much of it is under way.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        whom: For,
        compute: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, NotComputed> {
        let places = match whom {
            For::Commander => &self.commanders,
            For::Reader => &self.readers,
            For::Drive => &self.drives,
        };
        let permit = tokio::time::timeout(LONGEST_WAIT, places.clone().acquire_owned());
        let Ok(Ok(permit)) = permit.await else { return Err(NotComputed::Others) };
        let computed = self.handle.spawn_blocking(move || {
            let computed = compute();
            drop(permit);
            computed
        });
        computed.await.map_err(|_| NotComputed::Failed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    #[test]
    fn what_looks_after_a_drive_waits_for_no_commander_and_who_goes_away_is_waited_for_no_more() {
        let runtime = runtime().unwrap();
        let work = Work::new(runtime.handle().clone());
        let mut ends = Vec::new();
        for _ in 0..OF_COMMANDERS {
            let (end, ended) = mpsc::channel::<()>();
            let busy = work.clone();
            work.spawn(async move {
                let _ = busy.run(For::Commander, move || ended.recv()).await;
            });
            ends.push(end);
        }
        let (done, looked) = mpsc::channel();
        let looking = work.clone();
        work.spawn(async move {
            let _ = looking.run(For::Drive, move || done.send(())).await;
        });
        assert_eq!(looked.recv_timeout(Duration::from_secs(60)), Ok(()));
        drop(ends);
        // Whoever asked goes away while it is computed.
        let (begun, begins) = mpsc::channel();
        let (told, is_over) = mpsc::channel();
        let asking = work.clone();
        let asked = work.spawn(async move {
            let waits = Arc::new(());
            let waiting = Waiting::of(&waits);
            let compute = move || {
                let _ = begun.send(waiting.is_over());
                let begin = Instant::now();
                while !waiting.is_over() && begin.elapsed() < Duration::from_secs(60) {
                    std::thread::yield_now();
                }
                let _ = told.send(waiting.is_over());
            };
            let _ = asking.run(For::Reader, compute).await;
            drop(waits);
        });
        assert_eq!(begins.recv_timeout(Duration::from_secs(60)), Ok(false));
        asked.abort();
        assert_eq!(is_over.recv_timeout(Duration::from_secs(90)), Ok(true));
        // What fails isn't told to be busy.
        let failing = work.run::<()>(For::Reader, || panic!("on purpose"));
        assert_eq!(runtime.block_on(failing), Err(NotComputed::Failed));
        assert!(!Waiting::here().is_over() && !Waiting::here().is_longer_than(Duration::ZERO));
        assert!(Waiting::of(&Arc::new(())).is_longer_than(Duration::ZERO));
    }
}
