//! Who may do what.

use std::io::Read;
use std::net::{IpAddr, SocketAddr};

use axum::http::{HeaderMap, header};

/// The cookie that holds a page's token.
pub(crate) const COOKIE: &str = "omnibase_token";

/// Where the dashboard listens, and the secret of those who may command.
#[derive(Clone, Debug)]
pub struct Access {
    /// Address and port.
    pub address: SocketAddr,
    /// Whoever shows it may command; on loopback anybody may read.
    pub token: String,
}

/// What a client may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Right {
    /// Read and command.
    Command,
    /// Read.
    Read,
}

/// Why a client may do nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Denied {
    /// The request comes from a page of another origin, or by a name that isn't this host's.
    Origin,
    /// The token is missing or wrong.
    Token,
}

impl Denied {
    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            Denied::Origin => "refused: the request comes from another origin",
            Denied::Token => "refused: the token is missing or wrong",
        }
    }
}

impl Access {
    /// A dashboard at an address, with a token of 128 random bits.
    pub fn new(address: SocketAddr) -> std::io::Result<Self> {
        let mut bytes = [0; 16];
        std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
        Ok(Access { address, token: bytes.iter().map(|byte| format!("{byte:02x}")).collect() })
    }

    /// The address at which a person opens the page with the right to command.
    pub fn url(&self, address: SocketAddr) -> String {
        format!("http://{address}/?token={}", self.token)
    }

    /// What a request with these headers may do, from `peer`, where a token may stand in its address too.
    pub fn right(&self, peer: IpAddr, headers: &HeaderMap, in_query: Option<&str>) -> Result<Right, Denied> {
        let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
        let host = text(header::HOST).ok_or(Denied::Origin)?;
        // A name that somebody else's DNS points here is not this host's.
        if !is_address(host) {
            return Err(Denied::Origin);
        }
        if let Some(origin) = text(header::ORIGIN)
            && origin.strip_prefix("http://") != Some(host)
        {
            return Err(Denied::Origin);
        }
        let shown = in_query.or_else(|| text(header::AUTHORIZATION)?.strip_prefix("Bearer ")).or_else(|| {
            text(header::COOKIE)?.split(';').find_map(|pair| {
                let (name, value) = pair.trim().split_once('=')?;
                (name == COOKIE).then_some(value)
            })
        });
        match shown {
            Some(token) if is_same(token, &self.token) => Ok(Right::Command),
            // On loopback a stale token, such as a cookie of the run before, doesn't hinder reading.
            _ if peer.is_loopback() => Ok(Right::Read),
            _ => Err(Denied::Token),
        }
    }
}

/// Whether a host is an address or this machine's own name for itself.
fn is_address(host: &str) -> bool {
    let name = host.rsplit_once(':').map_or(host, |(name, port)| {
        if port.bytes().all(|byte| byte.is_ascii_digit()) { name } else { host }
    });
    let plain = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    name == "localhost" || plain.parse::<IpAddr>().is_ok()
}

/// Whether two secrets are the same, in a time that doesn't tell where they differ.
fn is_same(shown: &str, secret: &str) -> bool {
    shown.len() == secret.len()
        && shown.bytes().zip(secret.bytes()).fold(0, |differs, (a, b)| differs | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOPBACK: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);
    const ELSEWHERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::new(192, 168, 1, 7));

    fn right(peer: IpAddr, lines: &[(&'static str, &str)]) -> Result<Right, Denied> {
        let access = Access { address: "127.0.0.1:1".parse().unwrap(), token: "s3cret".into() };
        let headers = lines.iter().map(|(name, value)| {
            (header::HeaderName::from_static(name), header::HeaderValue::from_str(value).unwrap())
        });
        access.right(peer, &headers.collect(), None)
    }

    #[test]
    fn without_the_token_loopback_reads_and_others_do_nothing() {
        let host = ("host", "127.0.0.1:8400");
        assert_eq!(right(LOOPBACK, &[host]), Ok(Right::Read));
        assert_eq!(right(ELSEWHERE, &[host]), Err(Denied::Token));
        for wrong in ["Bearer s3cre", "Bearer s3creT", "Bearer ", "s3cret"] {
            assert_eq!(right(LOOPBACK, &[host, ("authorization", wrong)]), Ok(Right::Read), "{wrong}");
            assert_eq!(right(ELSEWHERE, &[host, ("authorization", wrong)]), Err(Denied::Token), "{wrong}");
        }
        let bearer = ("authorization", "Bearer s3cret");
        assert_eq!(right(ELSEWHERE, &[host, bearer]), Ok(Right::Command));
        let cookie = ("cookie", "other=1; omnibase_token=s3cret");
        assert_eq!(right(ELSEWHERE, &[host, cookie]), Ok(Right::Command));
    }

    #[test]
    fn another_origin_and_a_foreign_name_are_refused_even_with_the_token() {
        let bearer = ("authorization", "Bearer s3cret");
        for (host, origin) in [
            ("127.0.0.1:8400", "http://evil.example"),
            ("127.0.0.1:8400", "http://127.0.0.1:9000"),
            ("127.0.0.1:8400", "https://127.0.0.1:8400"),
            ("127.0.0.1:8400", "null"),
            ("rebound.example:8400", "http://rebound.example:8400"),
        ] {
            let refused = right(LOOPBACK, &[("host", host), ("origin", origin), bearer]);
            assert_eq!(refused, Err(Denied::Origin), "{host} {origin}");
        }
        for host in ["127.0.0.1:8400", "localhost:8400", "[::1]:8400", "192.168.1.7:8400", "192.168.1.7"] {
            let origin = format!("http://{host}");
            assert_eq!(right(LOOPBACK, &[("host", host), ("origin", &origin), bearer]), Ok(Right::Command));
        }
        assert_eq!(right(LOOPBACK, &[bearer]), Err(Denied::Origin), "no host at all");
    }
}
