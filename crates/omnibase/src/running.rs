//! Which running robot a command means, and the token that lets it command.

use crate::token;
use omnibase_client::Error;
use omnibase_client::robots::{Endpoint, Found, latest, robots};
use std::net::SocketAddr;
use std::path::Path;

/// The robot that is meant: at `address`, or the latest on this machine.
pub fn robot(address: Option<SocketAddr>, token_file: Option<&Path>) -> anyhow::Result<Found> {
    let known = match (robots(), address) {
        (Ok(known), _) => known,
        // Where address and token are given nothing is asked of the folder.
        (Err(_), Some(_)) if token_file.is_some() => Vec::new(),
        (Err(error), _) => return Err(error.into()),
    };
    let found = match address {
        Some(address) => known
            .into_iter()
            .find(|found| match found.place {
                Endpoint::Address(known) => known.port() == address.port() && address.ip().is_loopback(),
                Endpoint::Socket(_) => false,
            })
            .map(|found| Found { place: Endpoint::Address(address), ..found })
            .unwrap_or(Found {
                robot: String::new(),
                place: Endpoint::Address(address),
                token: String::new(),
            }),
        None => {
            anyhow::ensure!(
                !known.is_empty(),
                "{}: start one by `omnibase run <robot.toml> --dashboard` or at an interface, or say where by --at ADDRESS and \
                 --token-file FILE; a simulated run that nobody leads is over before it could answer",
                Error::NoRobot
            );
            latest()?
        }
    };
    // What is said comes first; the environment is for robots that didn't say their token here.
    let is_own = matches!(found.place, Endpoint::Socket(_));
    if is_own || (token_file.is_none() && !found.token.is_empty()) {
        return Ok(found);
    }
    let token = token::given(token_file)?.unwrap_or_default();
    Ok(Found { token, ..found })
}
