//! Where everything is computed that takes more than a moment: beside the thread that hears stops, and gentler.

use std::sync::Arc;
use std::time::Duration;

use tokio::runtime::{Handle, Runtime};
use tokio::sync::Semaphore;
use tokio::task::JoinHandle;

/// Computations of those who have the token, and of those who only look, at the same time.
const OF_COMMANDERS: usize = 2;
const OF_READERS: usize = 2;
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
}

/// Everything is busy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("other paths are being computed: ask again when they are done")]
pub(crate) struct Busy;

/// The threads that compute.
#[derive(Clone)]
pub(crate) struct Work {
    handle: Handle,
    commanders: Arc<Semaphore>,
    readers: Arc<Semaphore>,
}

/// The runtime of all that isn't a request: what computes, and what is told to all.
pub(crate) fn runtime() -> std::io::Result<Runtime> {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .max_blocking_threads(OF_COMMANDERS + OF_READERS)
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
        Work { handle, commanders: places(OF_COMMANDERS), readers: places(OF_READERS) }
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
    ) -> Result<T, Busy> {
        let places = match whom {
            For::Commander => &self.commanders,
            For::Reader => &self.readers,
        };
        let permit = tokio::time::timeout(LONGEST_WAIT, places.clone().acquire_owned());
        let Ok(Ok(permit)) = permit.await else { return Err(Busy) };
        let computed = self.handle.spawn_blocking(move || {
            let computed = compute();
            drop(permit);
            computed
        });
        computed.await.map_err(|_| Busy)
    }
}
