//! A page's connection, as a program makes it.

use tungstenite::WebSocket;
use tungstenite::stream::MaybeTlsStream;

/// Connects to the page's server at an address, with its token.
pub fn connect(address: &str, token: &str) -> WebSocket<MaybeTlsStream<std::net::TcpStream>> {
    let request = tungstenite::http::Request::builder()
        .uri(format!("ws://{address}/api/live"))
        .header("Host", address)
        .header("Authorization", format!("Bearer {token}"))
        .header("Connection", "Upgrade")
        .header("Upgrade", "websocket")
        .header("Sec-WebSocket-Version", "13")
        .header("Sec-WebSocket-Key", tungstenite::handshake::client::generate_key())
        .body(())
        .unwrap();
    tungstenite::connect(request).unwrap().0
}
