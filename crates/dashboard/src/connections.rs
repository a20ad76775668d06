//! As many connections as are reasonable, and no more.

use std::collections::HashMap;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};

use axum::serve::Listener;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};

use crate::seen::Counters;

/// Connections at the same time; more are closed at once.
const MOST: usize = 128;
/// Of them, those of one address: whoever holds connections open keeps nobody else from the stop.
const MOST_OF_ONE: usize = 48;

/// Who holds how many connections.
#[derive(Clone, Debug, Default)]
struct Places(Arc<Mutex<HashMap<IpAddr, usize>>>);

impl Places {
    fn held(&self) -> MutexGuard<'_, HashMap<IpAddr, usize>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A place for a connection from there, where there is one.
    fn take(&self, from: IpAddr) -> Option<Place> {
        let from = from.to_canonical();
        let mut held = self.held();
        let all: usize = held.values().sum();
        let of_one = held.get(&from).copied().unwrap_or(0);
        if all >= MOST || of_one >= MOST_OF_ONE {
            return None;
        }
        held.insert(from, of_one + 1);
        Some(Place { places: self.clone(), from })
    }
}

/// One connection's place; it is given back when this is dropped.
#[derive(Debug)]
struct Place {
    places: Places,
    from: IpAddr,
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut held = self.places.held();
        if let Some(count) = held.get_mut(&self.from) {
            *count -= 1;
            if *count == 0 {
                held.remove(&self.from);
            }
        }
    }
}

/// A listener that counts its connections.
pub(crate) struct Bounded {
    listener: TcpListener,
    places: Places,
    counters: Arc<Counters>,
}

impl Bounded {
    pub(crate) fn new(listener: TcpListener, counters: Arc<Counters>) -> Self {
        Bounded { listener, places: Places::default(), counters }
    }
}

impl Listener for Bounded {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        loop {
            let Ok((stream, address)) = self.listener.accept().await else {
                // Out of descriptors, say: a moment later there may be some.
                tokio::time::sleep(std::time::Duration::from_millis(100)).await;
                continue;
            };
            match self.places.take(address.ip()) {
                Some(place) => {
                    let _ = stream.set_nodelay(true);
                    return (Connection { stream, _place: place }, address);
                }
                None => Counters::count(&self.counters.crowded),
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A connection that gives its place back at its end.
pub(crate) struct Connection {
    stream: TcpStream,
    _place: Place,
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(cx, buffer)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(cx, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_holds_connections_open_leaves_places_for_others() {
        let places = Places::default();
        let address = |n: u8| IpAddr::from([192, 168, 1, n]);
        let mut of_one: Vec<Place> = std::iter::from_fn(|| places.take(address(1))).collect();
        assert_eq!(of_one.len(), MOST_OF_ONE);
        // The same one, by another way to write it.
        assert!(places.take("::ffff:192.168.1.1".parse().unwrap()).is_none());
        let other = places.take(address(2)).expect("a place for another");
        // One that goes makes room.
        of_one.pop();
        of_one.extend(places.take(address(1)));
        assert_eq!(of_one.len(), MOST_OF_ONE);
        let rest: Vec<Place> = (3..=250).filter_map(|n| places.take(address(n))).collect();
        assert_eq!(rest.len(), MOST - MOST_OF_ONE - 1);
        drop((of_one, other, rest));
        assert!(places.held().is_empty());
    }
}
