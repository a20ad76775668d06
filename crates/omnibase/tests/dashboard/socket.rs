//! A page's connection, as a program makes it.

use tungstenite::WebSocket;
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;

/// Connects to the page's server at an address, with its token.
pub fn connect(address: &str, token: &str) -> WebSocket<MaybeTlsStream<std::net::TcpStream>> {
    let mut request = format!("ws://{address}/api/live").into_client_request().unwrap();
    request.headers_mut().insert("Authorization", format!("Bearer {token}").parse().unwrap());
    tungstenite::connect(request).unwrap().0
}
