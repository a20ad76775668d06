//! Motive, as far as it is heard: what it says, byte by byte.

/// A rigid body as it is streamed: id, place, quaternion, error, tracked or not.
#[derive(Clone, Copy, Debug)]
pub struct Sent {
    pub id: u32,
    pub position: [f32; 3],
    pub rotation: [f32; 4],
    pub error: f32,
    pub flags: u16,
}

/// Bytes one after the other.
#[derive(Default)]
struct Bytes(Vec<u8>);

impl Bytes {
    fn u32(mut self, value: u32) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    fn raw(mut self, bytes: &[u8]) -> Self {
        self.0.extend(bytes);
        self
    }

    fn f32s(mut self, values: &[f32]) -> Self {
        self.0.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        self
    }
}

pub fn message(sort: u16, body: &[u8]) -> Vec<u8> {
    [&sort.to_le_bytes()[..], &(body.len() as u16).to_le_bytes(), body].concat()
}

/// What a server says of itself: a clock of so many ticks a second.
pub fn server_info([major, minor]: [u8; 2], ticks_per_s: u64) -> Vec<u8> {
    let mut name = b"Motive".to_vec();
    name.resize(256, 0);
    let versions = [3, 1, 0, 0, major, minor, 0, 0];
    let line = [&1511_u16.to_le_bytes()[..], &[1], &[239, 255, 42, 99]].concat();
    message(1, &[&name[..], &versions, &ticks_per_s.to_le_bytes(), &line].concat())
}

pub fn echo(asked: u64, ticks: u64) -> Vec<u8> {
    message(13, &[asked.to_le_bytes(), ticks.to_le_bytes()].concat())
}

fn body(sent: &Sent) -> Vec<u8> {
    let all = Bytes::default().u32(sent.id).f32s(&sent.position).f32s(&sent.rotation).f32s(&[sent.error]);
    all.raw(&sent.flags.to_le_bytes()).0
}

/// A frame with all sorts of things beside the rigid bodies; ticks when the shutters were open, and when it was sent.
pub fn frame([major, minor]: [u8; 2], number: u32, bodies: &[Sent], ticks: [u64; 2]) -> Vec<u8> {
    let is_sized = (major, minor) >= (4, 1);
    let section = |items: &[Vec<u8>]| {
        let all = items.concat();
        let head = Bytes::default().u32(items.len() as u32);
        if is_sized { head.u32(all.len() as u32) } else { head }.raw(&all).0
    };
    let marker_set = Bytes::default().raw(b"robot\0").u32(2).f32s(&[0.5; 6]).0;
    let skeleton = Bytes::default().u32(9).u32(1).raw(&body(&bodies[0])).0;
    let asset = Bytes::default().u32(4).u32(1).raw(&body(&bodies[0])).u32(1);
    let asset = asset.u32(7).f32s(&[0.1; 4]).raw(&[0; 2]).f32s(&[0.2]).0;
    let labelled = Bytes::default().u32(0x0001_0002).f32s(&[0.25; 4]).raw(&[10, 0]).f32s(&[0.001]).0;
    let plate = Bytes::default().u32(1).u32(2).u32(1).f32s(&[1.0]).u32(2).f32s(&[2.0, 3.0]).0;
    let streamed: Vec<Vec<u8>> = bodies.iter().map(body).collect();
    let mut all = Bytes::default().u32(number);
    all = all.raw(&section(&[marker_set])).raw(&section(&[Bytes::default().f32s(&[0.75; 3]).0]));
    all = all.raw(&section(&streamed)).raw(&section(&[skeleton]));
    if is_sized {
        all = all.raw(&section(&[asset]));
    }
    all = all
        .raw(&section(&[labelled.clone(), labelled]))
        .raw(&section(std::slice::from_ref(&plate)))
        .raw(&section(&[plate]));
    let [exposed, sent] = ticks;
    all = all.u32(0).u32(0).raw(&12.5_f64.to_le_bytes());
    for stamp in [exposed, exposed + 5, sent] {
        all = all.raw(&stamp.to_le_bytes());
    }
    if is_sized {
        all = all.u32(0).u32(0);
    }
    message(7, &all.raw(&[0; 2]).u32(0).0)
}

/// Who is in the frames.
pub fn descriptions([major, minor]: [u8; 2], bodies: &[(&str, u32)]) -> Vec<u8> {
    let one = |sort: u32, own: Vec<u8>| {
        let head = Bytes::default().u32(sort);
        if (major, minor) >= (4, 1) { head.u32(own.len() as u32) } else { head }.raw(&own).0
    };
    let text = |text: &str| [text.as_bytes(), &[0]].concat();
    let mut all = vec![one(0, Bytes::default().raw(&text("set")).u32(2).raw(&text("a")).raw(&text("b")).0)];
    for (name, id) in bodies {
        let mut own = Bytes::default().raw(&text(name)).u32(*id).u32(u32::MAX).f32s(&[0.0; 3]);
        if (major, minor) >= (4, 2) {
            own = own.f32s(&[0.0, 0.0, 0.0, 1.0]);
        }
        own = own.u32(2).f32s(&[0.1; 6]).u32(1).u32(2);
        if major >= 4 {
            own = own.raw(&text("left")).raw(&text("right"));
        }
        all.push(one(1, own.0));
    }
    // A camera stands behind them.
    all.push(one(5, Bytes::default().raw(&text("camera")).f32s(&[0.0; 7]).0));
    message(5, &Bytes::default().u32(all.len() as u32).raw(&all.concat()).0)
}
