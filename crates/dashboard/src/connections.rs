//! Who holds which connection. Nobody keeps anybody from the stop by holding some: whoever only holds a place, and has
//! not shown the token, gives it up to whoever comes.

use std::collections::HashMap;
use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::oneshot;

/// Connections on which nobody has shown the token.
const MOST: usize = 128;
/// Of them, those of one network elsewhere.
const MOST_OF_ONE: usize = 48;
/// Of them, those from elsewhere: the other places are this computer's.
const MOST_FROM_ELSEWHERE: usize = 96;
/// Of them, pages that look on.
const MOST_LOOKING: usize = 32;
/// Connections on which the token was shown; they give way to nobody.
const MOST_PROVEN: usize = 64;

/// The longest body that is read at once; a longer one is read where it holds nobody up.
pub(crate) const READ_AT_ONCE: usize = 4 * 1024;
/// A page, or a program, that takes nothing for so long is gone.
pub(crate) const STUCK: Duration = Duration::from_secs(3);

/// Addresses that count as one: an IPv4 address, what one household has of IPv6 (/64), this computer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Network(IpAddr);

impl Network {
    /// The one of an address.
    pub(crate) fn of(address: IpAddr) -> Self {
        Network(match address.to_canonical() {
            address if address.is_loopback() => IpAddr::V4(Ipv4Addr::LOCALHOST),
            IpAddr::V6(address) => {
                let host_bits = u128::from(u64::MAX);
                IpAddr::V6(Ipv6Addr::from_bits(address.to_bits() & !host_bits))
            }
            address => address,
        })
    }

    fn is_here(self) -> bool {
        self.0.is_loopback()
    }
}

/// What a connection is about: whoever waits for nothing goes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum State {
    /// Nothing was asked yet, or everything is answered.
    Waits,
    /// A request is under way.
    Asks,
    /// A page looks on.
    Looks,
}

/// One connection's entry.
struct Held {
    from: Network,
    state: State,
    is_proven: bool,
    /// Ends it when it is dropped.
    _life: oneshot::Sender<()>,
}

/// All places; numbers rise, so that the least is the oldest.
#[derive(Default)]
struct Table {
    next: u64,
    held: HashMap<u64, Held>,
}

impl Table {
    fn count(&self, counts: impl Fn(&Held) -> bool) -> usize {
        self.held.values().filter(|held| counts(held)).count()
    }

    /// Ends the connection that does least for longest, of those that fit.
    fn evict(&mut self, fits: impl Fn(&Held) -> bool) {
        let fitting = self.held.iter().filter(|(_, held)| !held.is_proven && fits(held));
        let victim = fitting.map(|(number, held)| (held.state, *number)).min();
        if let Some((_, number)) = victim {
            self.held.remove(&number);
        }
    }

    /// Whose connections are the most.
    fn fullest(&self) -> Option<Network> {
        let mut counts: HashMap<Network, usize> = HashMap::new();
        for held in self.held.values().filter(|held| !held.is_proven) {
            *counts.entry(held.from).or_default() += 1;
        }
        counts.into_iter().max_by_key(|(_, count)| *count).map(|(network, _)| network)
    }

    /// Makes room for one more from there; whether somebody had to go.
    fn make_room(&mut self, from: Network) -> bool {
        let (mut all, mut elsewhere, mut of_one) = (0, 0, 0);
        for held in self.held.values().filter(|held| !held.is_proven) {
            all += 1;
            elsewhere += usize::from(!held.from.is_here());
            of_one += usize::from(held.from == from);
        }
        let is_elsewhere = !from.is_here();
        if is_elsewhere && of_one >= MOST_OF_ONE {
            self.evict(|held| held.from == from);
        } else if is_elsewhere && elsewhere >= MOST_FROM_ELSEWHERE {
            self.evict(|held| !held.from.is_here());
        } else if all >= MOST {
            let fullest = self.fullest();
            self.evict(|held| Some(held.from) == fullest);
        } else {
            return false;
        }
        true
    }
}

/// The places for connections.
#[derive(Clone, Default)]
pub(crate) struct Places(Arc<Mutex<Table>>);

impl Places {
    fn table(&self) -> MutexGuard<'_, Table> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A place for whoever comes, and whether somebody else had to go for it.
    pub(crate) fn take(&self, from: IpAddr) -> (Slot, bool) {
        let from = Network::of(from);
        let mut table = self.table();
        let is_crowded = table.make_room(from);
        let number = table.next;
        table.next += 1;
        let (life, ended) = oneshot::channel();
        table.held.insert(number, Held { from, state: State::Waits, is_proven: false, _life: life });
        (Slot { seat: Seat { places: self.clone(), number }, ended: Some(ended) }, is_crowded)
    }
}

/// One connection's place; it is given back when this is dropped.
pub(crate) struct Slot {
    seat: Seat,
    /// `None` once it was taken away.
    ended: Option<oneshot::Receiver<()>>,
}

impl Slot {
    /// By which its requests tell what they are about.
    pub(crate) fn seat(&self) -> Seat {
        self.seat.clone()
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        self.seat.places.table().held.remove(&self.seat.number);
    }
}

/// A connection's place, as its requests see it.
#[derive(Clone)]
pub(crate) struct Seat {
    places: Places,
    number: u64,
}

impl Seat {
    /// Whether the token was shown on it.
    pub(crate) fn is_proven(&self) -> bool {
        self.places.table().held.get(&self.number).is_some_and(|held| held.is_proven)
    }

    /// The token was shown: where there is room among those, it gives way to nobody from now on.
    pub(crate) fn prove(&self) {
        let mut table = self.places.table();
        let has_room = table.count(|held| held.is_proven) < MOST_PROVEN;
        if let Some(held) = table.held.get_mut(&self.number) {
            held.is_proven |= has_room;
        }
    }

    /// A request is under way as long as that is kept.
    pub(crate) fn ask(&self) -> Asking {
        self.be(State::Asks);
        Asking(self.clone())
    }

    /// A page looks on from here on; `false` where there are enough of them without a token.
    pub(crate) fn look(&self) -> bool {
        let mut table = self.places.table();
        let looking = table.count(|held| !held.is_proven && held.state == State::Looks);
        match table.held.get_mut(&self.number) {
            Some(held) if held.is_proven || looking < MOST_LOOKING => {
                held.state = State::Looks;
                true
            }
            _ => false,
        }
    }

    fn be(&self, state: State) {
        if let Some(held) = self.places.table().held.get_mut(&self.number)
            && held.state != State::Looks
        {
            held.state = state;
        }
    }
}

/// A request that is under way.
pub(crate) struct Asking(Seat);

impl Drop for Asking {
    fn drop(&mut self) {
        self.0.be(State::Waits);
    }
}

/// A connection that ends when its place is taken, and gives it back at its own end.
pub(crate) struct Connection<S> {
    stream: S,
    place: Slot,
}

impl<S> Connection<S> {
    pub(crate) fn new(stream: S, place: Slot) -> Self {
        Connection { stream, place }
    }

    /// Fails once its place is taken, and wakes whoever waits for it then.
    fn poll_place(&mut self, cx: &mut Context<'_>) -> io::Result<()> {
        if let Some(ended) = &mut self.place.ended
            && Pin::new(ended).poll(cx).is_pending()
        {
            return Ok(());
        }
        self.place.ended = None;
        Err(io::ErrorKind::ConnectionAborted.into())
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Connection<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        self.poll_place(cx)?;
        Pin::new(&mut self.stream).poll_read(cx, buffer)
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Connection<S> {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        self.poll_place(cx)?;
        Pin::new(&mut self.stream).poll_write(cx, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

/// Who is at the other end, and on which place.
#[derive(Clone)]
pub(crate) struct Peer {
    pub(crate) address: SocketAddr,
    /// It came by the socket that nobody but the robot's user can open.
    pub(crate) is_owner: bool,
    pub(crate) seat: Seat,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(n: u8) -> IpAddr {
        IpAddr::from([192, 168, 1, n])
    }

    fn is_ended(place: &mut Slot) -> bool {
        let ended = place.ended.as_mut().map(|ended| ended.try_recv());
        ended == Some(Err(oneshot::error::TryRecvError::Closed))
    }

    /// So many from an address; a newcomer always gets a place.
    fn held(places: &Places, from: IpAddr, count: usize) -> Vec<Slot> {
        (0..count).map(|_| places.take(from).0).collect()
    }

    #[test]
    fn addresses_of_one_owner_count_as_one() {
        let network = |text: &str| Network::of(text.parse().unwrap());
        assert_eq!(network("192.168.1.7"), network("::ffff:192.168.1.7"));
        assert_ne!(network("192.168.1.7"), network("192.168.1.8"));
        assert_eq!(network("2001:db8:1:2::1"), network("2001:db8:1:2:ffff:ffff:ffff:ffff"));
        assert_ne!(network("2001:db8:1:2::1"), network("2001:db8:1:3::1"));
        for here in ["127.0.0.1", "127.0.0.3", "::1", "::ffff:127.0.0.2"] {
            assert!(network(here).is_here() && network(here) == network("127.0.0.1"), "{here}");
        }
    }

    #[test]
    fn whoever_holds_too_many_loses_its_own_oldest_and_nobody_elses() {
        let places = Places::default();
        let (mut other, _) = places.take(address(2));
        let mut of_one = held(&places, address(1), MOST_OF_ONE + 10);
        let ended: Vec<bool> = of_one.iter_mut().map(is_ended).collect();
        assert!(ended.iter().enumerate().all(|(n, ended)| *ended == (n < 10)), "{ended:?}");
        assert!(!is_ended(&mut other));
        drop((of_one, other));
        assert!(places.table().held.is_empty());
    }

    #[test]
    fn places_are_kept_for_this_computer_and_for_whoever_showed_the_token() {
        let places = Places::default();
        let here = IpAddr::from([127, 0, 0, 1]);
        let mut own = held(&places, here, MOST - MOST_FROM_ELSEWHERE);
        let (mut proven, _) = places.take(address(1));
        proven.seat().prove();
        let _flood: Vec<Slot> = (1..=250).flat_map(|n| held(&places, address(n), 2)).collect();
        assert!(own.iter_mut().all(|place| !is_ended(place)) && !is_ended(&mut proven));
        // Nor does this computer itself drive out who showed the token.
        let _here = held(&places, here, 1000);
        assert!(!is_ended(&mut proven));
        assert_eq!(places.table().count(|held| !held.is_proven), MOST);
    }

    #[test]
    fn whoever_only_holds_a_place_goes_before_who_asks_and_who_asks_before_who_looks() {
        let places = Places::default();
        let mut of_one = held(&places, address(1), MOST_OF_ONE);
        assert!(of_one[0].seat().look());
        let asking = of_one[1].seat().ask();
        let _more = held(&places, address(1), 1);
        assert_eq!(of_one.iter_mut().position(is_ended), Some(2));
        drop(asking);
        let _more = (_more, held(&places, address(1), 1));
        assert_eq!(of_one.iter_mut().position(is_ended), Some(1));
    }

    #[test]
    fn pages_without_the_token_are_bounded_those_with_it_are_not() {
        let places = Places::default();
        let here = IpAddr::from([127, 0, 0, 1]);
        let all = held(&places, here, MOST_LOOKING + 1);
        let looking = all.iter().filter(|place| place.seat().look()).count();
        assert_eq!(looking, MOST_LOOKING);
        let last = all[MOST_LOOKING].seat();
        last.prove();
        assert!(last.is_proven() && last.look());
    }
}
