//! Whoever asks is let in here: tokens, how often one may ask, and what was turned away.

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::Json;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};

use crate::access::{Access, COOKIE, Denied, Right};
use crate::call::CallResult;
use crate::connections::{Asking, Network, Peer};
use crate::status::Counters;
use crate::strangers::{Strangers, TooMuch};

/// Who may come in, and what was turned away.
#[derive(Clone)]
pub(crate) struct Gate {
    access: Arc<Access>,
    strangers: Arc<Strangers>,
    began: Instant,
    pub(crate) counters: Arc<Counters>,
}

/// A request that is under way; at its end there is room for another one of its network.
pub(crate) struct Underway {
    gate: Gate,
    network: Network,
    _asking: Asking,
}

impl Drop for Underway {
    fn drop(&mut self) {
        self.gate.strangers.end(self.network);
    }
}

impl Gate {
    pub(crate) fn new(access: Access, counters: Arc<Counters>) -> Self {
        Gate { access: Arc::new(access), strangers: Arc::default(), began: Instant::now(), counters }
    }

    /// Lets everybody else have a turn, and begins where the request may.
    pub(crate) async fn begun(
        &self,
        peer: &Peer,
        headers: &HeaderMap,
        token: Option<&str>,
    ) -> Result<(Right, Underway), Response> {
        tokio::task::yield_now().await;
        let right = self.right(peer, headers, token).map_err(|denied| self.refuse(denied))?;
        let underway = self.begin(peer).map_err(IntoResponse::into_response)?;
        Ok((right, underway))
    }

    /// The right of a request.
    pub(crate) fn right(
        &self,
        peer: &Peer,
        headers: &HeaderMap,
        in_query: Option<&str>,
    ) -> Result<Right, Denied> {
        if peer.is_owner {
            return Ok(Right::Command);
        }
        let shown = self.access.shown(headers, in_query)?;
        let (now, network) = (self.began.elapsed(), Network::of(peer.address.ip()));
        let Some(token) = shown else { return self.access.right(peer.address.ip(), None) };
        // Whoever showed it on this connection before is no guesser.
        if let Some(wait) = self.strangers.wait(now, network)
            && !peer.seat.is_proven()
        {
            return Err(Denied::Wait(wait));
        }
        let right = self.access.right(peer.address.ip(), shown);
        match right {
            Ok(Right::Command) => peer.seat.prove(),
            Ok(Right::Read) | Err(_) => self.strangers.wrong(now, network, token),
        }
        right
    }

    /// The right of a stop, or its release: tokens are always looked at, for nobody guesses 128 bits, and neither waits.
    pub(crate) fn right_to_stop(&self, peer: &Peer, headers: &HeaderMap) -> Result<Right, Denied> {
        if peer.is_owner {
            return Ok(Right::Command);
        }
        let shown = self.access.shown(headers, None)?;
        self.access.right(peer.address.ip(), shown)
    }

    pub(crate) fn refuse(&self, denied: Denied) -> Response {
        Counters::count(&self.counters.denied);
        match denied {
            Denied::Wait(wait) => {
                let wait_s = wait.as_secs_f64().ceil().to_string();
                let headers = [(header::RETRY_AFTER, wait_s), (header::CONNECTION, "close".to_owned())];
                (StatusCode::TOO_MANY_REQUESTS, headers, denied.text()).into_response()
            }
            Denied::Origin | Denied::Token | Denied::Site | Denied::Hosts => {
                (StatusCode::FORBIDDEN, denied.text()).into_response()
            }
        }
    }

    /// A request that is no stop begins, where its network didn't ask too much.
    pub(crate) fn begin(&self, peer: &Peer) -> Result<Underway, TooMuch> {
        let network = Network::of(peer.address.ip());
        self.strangers.begin(self.began.elapsed(), network).inspect_err(|_| {
            Counters::count(&self.counters.flooding);
        })?;
        Ok(Underway { gate: self.clone(), network, _asking: peer.seat.ask() })
    }

    /// Time since the server began.
    pub(crate) fn elapsed(&self) -> Duration {
        self.began.elapsed()
    }
}

/// The token goes from the address into a cookie, so that it isn't shown, kept or sent on.
pub(crate) fn to_cookie(token: &str) -> Response {
    let cookie = format!("{COOKIE}={token}; HttpOnly; SameSite=Strict; Path=/");
    (StatusCode::SEE_OTHER, [(header::SET_COOKIE, cookie.as_str()), (header::LOCATION, "/")]).into_response()
}

impl IntoResponse for TooMuch {
    fn into_response(self) -> Response {
        let why = match self {
            TooMuch::Rate => "this address asks too often",
            TooMuch::Asking => "this address asks too much at the same time",
        };
        let headers = [(header::RETRY_AFTER, "1"), (header::CONNECTION, "close")];
        (StatusCode::TOO_MANY_REQUESTS, headers, Json(CallResult::refused(why))).into_response()
    }
}
