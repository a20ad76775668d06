//! The server: a thread that takes connections and hears what is asked, and computes nothing itself.
//!
//! A stop waits for what that thread has in hand, which is never more than a message of a few kB, and for nothing else:
//! no lock that is held while something is computed, no place in a list. What computes does so [beside](crate::work).

use std::any::Any;
use std::fs::Permissions;
use std::net::{Ipv4Addr, SocketAddr};
use std::os::unix::fs::PermissionsExt;
use std::panic::AssertUnwindSafe;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use axum::Router;
use hyper::Request;
use hyper::body::Incoming;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use omnibase_run::live::Live;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream, UnixListener, UnixStream};
use tokio::sync::oneshot;

use crate::access::Access;
use crate::call_handler::CallHandler;
use crate::connections::{Connection, Peer, Places};
use crate::robot_info::RobotInfo;
use crate::routes;
use crate::shared::Shared;
use crate::status::Counters;
use crate::tick::tick;
use crate::work::{self, For, Work};
use crate::{drive_to, foxglove, streams};

/// The longest time from one request, or the beginning, to the end of the next one's header.
const HEADER: Duration = Duration::from_secs(10);
/// The longest header, bytes.
const LONGEST_HEADER: usize = 16 * 1024;
/// Connections that wait to be taken: whoever comes last waits for all of them, some 0.1 ms each.
const BACKLOG: i32 = 256;
/// Turns of the thread's tasks after which it looks who has come.
const LOOKS_UP: u32 = 8;

/// Why there is no dashboard.
#[derive(Debug, thiserror::Error)]
pub enum DashboardError {
    /// Its address can't be had.
    #[error("the dashboard's address {address}: {error}")]
    Address {
        /// The address.
        address: SocketAddr,
        /// Why.
        error: std::io::Error,
    },
    /// Its socket can't be made.
    #[error("the robot's socket {path}: {error}")]
    Socket {
        /// The socket.
        path: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// Its thread can't be started.
    #[error("the dashboard's thread: {0}")]
    Thread(std::io::Error),
}

/// A running dashboard; it ends when it is dropped.
pub struct Dashboard {
    /// Where it listens.
    pub address: SocketAddr,
    /// Where it shows the robot to the Foxglove app.
    pub foxglove: Option<SocketAddr>,
    counters: Arc<Counters>,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
    kept: Kept,
}

/// What is kept as long as the server lives.
type Kept = Arc<Mutex<Vec<Box<dyn Any + Send>>>>;

/// How a server ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ended {
    /// As it was told.
    AsTold,
    /// By itself: there should be one.
    ByItself,
}

impl Dashboard {
    /// Serves a robot's page.
    pub fn start(access: Access, live: Live, about: RobotInfo) -> Result<Dashboard, DashboardError> {
        let (listener, address) = listen(access.address)?;
        Dashboard::serve(Door::Network(listener), address, access, live, about)
    }

    /// Serves the same API, without a page's address and without a token, to whoever can open this socket: its folder must
    /// be of mode 0700.
    pub fn start_for_owner(path: &Path, live: Live, about: RobotInfo) -> Result<Dashboard, DashboardError> {
        let failed = |error| DashboardError::Socket { path: path.to_owned(), error };
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        // Its token is shown to nobody.
        let access = Access::new(address).map_err(failed)?;
        let listener = std::os::unix::net::UnixListener::bind(path).map_err(failed)?;
        std::fs::set_permissions(path, Permissions::from_mode(0o600)).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        Dashboard::serve(Door::Owner(listener), address, access, live, about)
    }

    fn serve(
        door: Door,
        address: SocketAddr,
        access: Access,
        live: Live,
        about: RobotInfo,
    ) -> Result<Dashboard, DashboardError> {
        let viewers = about.streams.foxglove.map(listen).transpose()?;
        let foxglove = viewers.as_ref().map(|(_, address)| *address);
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            // However many are ready: who comes is looked at in between.
            .event_interval(LOOKS_UP)
            .build()
            .map_err(DashboardError::Thread)?;
        let beside = work::runtime().map_err(DashboardError::Thread)?;
        let counters = Arc::new(Counters::default());
        let (end, ended) = oneshot::channel();
        let kept = Kept::default();
        let (shared, kept_there) = (counters.clone(), kept.clone());
        let thread = std::thread::Builder::new().name("dashboard".into()).spawn(move || {
            watched(&live.clone(), || {
                let work = Work::new(beside.handle().clone());
                let shared = Shared::new(access, CallHandler::new(live, about), shared, work);
                runtime.block_on(serve(door, viewers.map(|(listener, _)| listener), shared, ended))
            });
            // What is being computed for nobody any more holds nothing up.
            beside.shutdown_background();
            kept_there.lock().unwrap_or_else(PoisonError::into_inner).clear();
        });
        Ok(Dashboard {
            address,
            foxglove,
            counters,
            end: Some(end),
            thread: Some(thread.map_err(DashboardError::Thread)?),
            kept,
        })
    }

    /// Keeps something as long as the server lives, such as the word where it listens.
    pub fn keep(&self, kept: impl Any + Send) {
        let is_over = self.thread.as_ref().is_none_or(JoinHandle::is_finished);
        if !is_over {
            self.kept.lock().unwrap_or_else(PoisonError::into_inner).push(Box::new(kept));
        }
    }

    /// What came in and was not carried out: crowded, denied, malformed, oversized, flooding.
    pub fn counts(&self) -> [u64; 5] {
        self.counters.all()
    }
}

/// Serves; where that ends by itself, or by a panic, what pages command ends with it, and the run says so.
fn watched(live: &Live, serve: impl FnOnce() -> Ended) {
    // What the panic left half done is never looked at again.
    let ended = std::panic::catch_unwind(AssertUnwindSafe(serve));
    if !matches!(ended, Ok(Ended::AsTold)) {
        live.lose_pages();
    }
}

impl Drop for Dashboard {
    fn drop(&mut self) {
        if let Some(end) = self.end.take() {
            let _ = end.send(());
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A place where people come, and its address.
pub(crate) fn listen(address: SocketAddr) -> Result<(std::net::TcpListener, SocketAddr), DashboardError> {
    let failed = |error| DashboardError::Address { address, error };
    let listener = std::net::TcpListener::bind(address).map_err(failed)?;
    // Those that come all at once wait to be taken: where they are turned away they come again after a second.
    rustix::net::listen(&listener, BACKLOG).map_err(|error| failed(error.into()))?;
    // Whoever is taken there has it, too.
    rustix::net::sockopt::set_tcp_nodelay(&listener, true).map_err(|error| failed(error.into()))?;
    listener.set_nonblocking(true).map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    Ok((listener, address))
}

/// Takes those who come there, until that ends by itself.
pub(crate) async fn accept_network(listener: std::net::TcpListener, counters: Arc<Counters>, routes: Router) {
    if let Ok(listener) = TcpListener::from_std(listener) {
        accept(Listener::Network(listener), counters, routes).await;
    }
}

async fn serve(
    door: Door,
    viewers: Option<std::net::TcpListener>,
    shared: Shared,
    ended: oneshot::Receiver<()>,
) -> Ended {
    let listener = match door {
        Door::Network(listener) => TcpListener::from_std(listener).map(Listener::Network),
        Door::Owner(listener) => UnixListener::from_std(listener).map(Listener::Owner),
    };
    let Ok(listener) = listener else { return Ended::ByItself };
    let ticking = shared.work.spawn(tick(shared.clone()));
    shared.work.spawn(look_after_drives(shared.clone()));
    if let Some(target) = shared.desk.about.streams.plotjuggler {
        shared.work.spawn(streams::plot(shared.live.clone(), shared.desk.about.rows(), target));
    }
    if let Some(listener) = viewers {
        let (routes, counters) = (foxglove::show(&shared), shared.gate.counters.clone());
        shared.work.spawn(accept_network(listener, counters, routes));
    }
    let accepting = tokio::spawn(accept(listener, shared.gate.counters.clone(), routes::all(shared)));
    let over = async {
        let _ = ended.await;
    };
    // Connections that stay open don't hold the end up.
    tokio::select! {
        _ = accepting => Ended::ByItself,
        // It never ends but by a panic; without it pages see nothing any more.
        _ = ticking => Ended::ByItself,
        () = over => Ended::AsTold,
    }
}

/// Looks again and again after a way to a pose that is under way; elsewhere, for it plans.
async fn look_after_drives(shared: Shared) {
    let mut interval = tokio::time::interval(drive_to::LOOK);
    interval.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        interval.tick().await;
        if shared.desk.drive_to.is_under_way() {
            let desk = shared.desk.clone();
            let _ = shared.work.run(For::Drive, move || desk.look_after_drive()).await;
        }
    }
}

/// By what people come.
enum Door {
    /// An address and a port.
    Network(std::net::TcpListener),
    /// A socket that nobody but the robot's user can open.
    Owner(std::os::unix::net::UnixListener),
}

/// As [`Door`], while it is served.
enum Listener {
    Network(TcpListener),
    Owner(UnixListener),
}

/// Who came.
enum Comer {
    Stranger(TcpStream, SocketAddr),
    Owner(UnixStream),
}

impl Listener {
    async fn accept(&self) -> std::io::Result<Comer> {
        match self {
            Listener::Network(listener) => {
                listener.accept().await.map(|(stream, address)| Comer::Stranger(stream, address))
            }
            Listener::Owner(listener) => listener.accept().await.map(|(stream, _)| Comer::Owner(stream)),
        }
    }
}

async fn accept(listener: Listener, counters: Arc<Counters>, routes: Router) {
    let places = Places::default();
    loop {
        let Ok(comer) = listener.accept().await else {
            // Out of descriptors, say: a moment later there may be some.
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        let (address, is_owner) = match &comer {
            Comer::Stranger(_, address) => (*address, false),
            Comer::Owner(_) => (SocketAddr::from((Ipv4Addr::LOCALHOST, 0)), true),
        };
        let (place, is_crowded) = places.take(address.ip());
        if is_crowded {
            Counters::count(&counters.crowded);
        }
        let peer = Peer { address, is_owner, seat: place.seat() };
        match comer {
            Comer::Stranger(stream, _) => talk(Connection::new(stream, place), peer, routes.clone()),
            Comer::Owner(stream) => talk(Connection::new(stream, place), peer, routes.clone()),
        }
        // What it asks is heard before so many others come that its place is taken from it.
        tokio::task::yield_now().await;
    }
}

/// Answers what is asked on a connection, as long as it lasts.
fn talk<S>(connection: Connection<S>, peer: Peer, routes: Router)
where
    Connection<S>: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let mut http = hyper::server::conn::http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(HEADER).max_buf_size(LONGEST_HEADER);
    let routes = TowerToHyperService::new(routes);
    let service = service_fn(move |mut request: Request<Incoming>| {
        request.extensions_mut().insert(peer.clone());
        routes.call(request)
    });
    let connection = http.serve_connection(TokioIo::new(connection), service);
    tokio::spawn(async move {
        // Whatever it ends by, it is its own end.
        let _ = connection.with_upgrades().await;
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_robot::signals::{CycleRecord, Phase, StopCategory};
    use omnibase_robot::{Request, RequestKind};
    use omnibase_run::live::{Ages, Ask, LiveEnd, StickWish, live};

    /// A page drives, and then its server ends so; what the robot is asked in the cycle after it, and what is said.
    fn after(serve: impl FnOnce() -> Ended) -> (Option<RequestKind>, Option<&'static str>) {
        let ages = Ages { stick_ns: u64::MAX, session_ns: u64::MAX };
        let (live, mut end): (Live, LiveEnd) = live(ages, StopCategory::RampThenRemove, &[]);
        let page = live.begin_session().unwrap();
        let held = StickWish::Held { twist: Default::default(), frame: Default::default() };
        for wish in [StickWish::Released, held] {
            live.send(page, Ask::Stick(wish)).unwrap();
        }
        let record = CycleRecord::default();
        let asked = |request: Option<Request>| request.map(|request| request.kind);
        let driven = asked(end.turn(1, &record, Phase::Holding).request);
        assert!(matches!(driven, Some(RequestKind::Velocity { .. })), "{driven:?}");
        while end.take_note().is_some() {}
        watched(&live, serve);
        let request = asked(end.turn(2, &record, Phase::Tracking).request);
        (request, end.take_note().map(|note| note.text))
    }

    #[test]
    fn a_server_that_dies_ends_what_its_pages_commanded_and_the_run_says_so() {
        let (stopped, said) =
            (Some(RequestKind::Stop(StopCategory::RampAndHold)), "the server of the pages died");
        for (serve, is_dead) in [
            ((|| panic!("as a test wishes")) as fn() -> Ended, true),
            (|| Ended::ByItself, true),
            (|| Ended::AsTold, false),
        ] {
            let (request, note) = after(serve);
            assert_eq!(request == stopped, is_dead, "{request:?}");
            assert_eq!(note.is_some_and(|note| note.starts_with(said)), is_dead, "{note:?}");
        }
    }
}
