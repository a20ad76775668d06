//! Who may do what.

use std::borrow::Cow;
use std::io::Read;
use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

use axum::http::{HeaderMap, header};

/// The cookie that holds a page's token.
pub(crate) const COOKIE: &str = "omnibase_token";

/// What a browser says of whose page a request comes from.
const FETCH_SITE: &str = "sec-fetch-site";

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
    /// The request comes from a page of another site.
    Site,
    /// It names more than one host.
    Hosts,
    /// Too many wrong tokens came from its network: no other one is looked at yet.
    Wait(Duration),
}

impl Denied {
    /// In words.
    pub fn text(self) -> Cow<'static, str> {
        Cow::Borrowed(match self {
            Denied::Origin => "refused: the request comes from another origin",
            Denied::Token => "refused: the token is missing or wrong",
            Denied::Site => {
                "refused: the request comes from a page of another site: type or paste the robot's address instead"
            }
            Denied::Hosts => "refused: expected one Host, found several",
            Denied::Wait(wait) => {
                let wait_s = wait.as_secs_f64().ceil();
                return format!(
                    "refused: too many wrong tokens came from this address; the next one is looked at in {wait_s} s"
                )
                .into();
            }
        })
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

    /// The token that a request shows, where it comes from nobody else's page; one may stand in its address too.
    pub fn shown<'a>(
        &self,
        headers: &'a HeaderMap,
        in_query: Option<&'a str>,
    ) -> Result<Option<&'a str>, Denied> {
        let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
        if headers.get_all(header::HOST).iter().count() > 1 {
            return Err(Denied::Hosts);
        }
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
        // A link on somebody else's page, or what that page fetches.
        if headers.get_all(FETCH_SITE).iter().any(|site| site == "cross-site") {
            return Err(Denied::Site);
        }
        Ok(in_query.or_else(|| text(header::AUTHORIZATION)?.strip_prefix("Bearer ")).or_else(|| {
            text(header::COOKIE)?.split(';').find_map(|pair| {
                let (name, value) = pair.trim().split_once('=')?;
                (name == COOKIE).then_some(value)
            })
        }))
    }

    /// Whether that is the token.
    pub fn is_token(&self, shown: &str) -> bool {
        is_same(shown, &self.token)
    }

    /// What a request may do that shows that token, or none, from `peer`.
    pub fn right(&self, peer: IpAddr, shown: Option<&str>) -> Result<Right, Denied> {
        match shown {
            Some(token) if self.is_token(token) => Ok(Right::Command),
            // On loopback a stale token, such as a cookie of the run before, doesn't hinder reading.
            _ if peer.to_canonical().is_loopback() => Ok(Right::Read),
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
        let headers = headers.collect();
        access.shown(&headers, None).and_then(|shown| access.right(peer, shown))
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

    #[test]
    fn a_page_of_another_site_and_a_second_host_are_refused_even_with_the_token() {
        let host = ("host", "127.0.0.1:8400");
        let bearer = ("authorization", "Bearer s3cret");
        for (site, expected) in [
            ("cross-site", Err(Denied::Site)),
            ("same-origin", Ok(Right::Command)),
            ("none", Ok(Right::Command)),
        ] {
            assert_eq!(right(LOOPBACK, &[host, bearer, ("sec-fetch-site", site)]), expected, "{site}");
        }
        let access = Access { address: "127.0.0.1:1".parse().unwrap(), token: "s3cret".into() };
        let mut headers = HeaderMap::new();
        for _ in 0..2 {
            headers.append(header::HOST, "127.0.0.1:8400".parse().unwrap());
        }
        assert_eq!(access.shown(&headers, None), Err(Denied::Hosts));
    }
}
