//! Delays from receive times of made-up segments; the times are those that frames would really have.

use super::*;
use crate::subdevice::PortKind;

/// Cable delay between two neighbours, one way, ns.
const CABLE: u32 = 150;

struct Node {
    /// Port of the parent and its number; `None` for the first.
    parent: Option<(usize, u8)>,
    has_clock: bool,
}

fn node(parent: Option<(usize, u8)>) -> Node {
    Node { parent, has_clock: true }
}

/// Sends a frame through the tree; gives what is latched, and when the frame truly arrived at each.
fn latch(nodes: &[Node]) -> (Vec<Latched>, Vec<u32>) {
    let children = |of: usize, port: u8| nodes.iter().position(|node| node.parent == Some((of, port)));
    let mut arrivals = vec![0; nodes.len()];
    let mut times = vec![[0; 4]; nodes.len()];
    fn pass(
        number: usize,
        mut now: u32,
        children: &dyn Fn(usize, u8) -> Option<usize>,
        arrivals: &mut [u32],
        times: &mut [[u32; 4]],
    ) -> u32 {
        arrivals[number] = now;
        // Each clock counts from another instant, and wraps.
        let local = |now: u32| now.wrapping_add(0xFFFF_FE00).wrapping_add(number as u32 * 77);
        times[number][0] = local(now);
        for port in [3, 1, 2] {
            if let Some(child) = children(number, port) {
                now = pass(child, now + CABLE, children, arrivals, times) + CABLE;
                times[number][usize::from(port)] = local(now);
            }
        }
        now
    }
    pass(0, 0, &children, &mut arrivals, &mut times);
    let latched = nodes
        .iter()
        .enumerate()
        .map(|(number, node)| Latched {
            ports: core::array::from_fn(|port| {
                let communicates = port == 0 || children(number, port as u8).is_some();
                Port { kind: PortKind::Mii, link: communicates, communicates }
            }),
            parent: node.parent.map(|(position, port)| Parent { position: position as u16, port }),
            times_ns: node.has_clock.then_some(times[number]),
        })
        .collect();
    (latched, arrivals)
}

#[test]
fn delays_in_a_line_are_those_of_the_frame() {
    let nodes: Vec<_> = (0..5).map(|n: usize| node(n.checked_sub(1).map(|parent| (parent, 1)))).collect();
    let (latched, arrivals) = latch(&nodes);
    assert_eq!(delays(&latched).unwrap(), arrivals.into_iter().map(Some).collect::<Vec<_>>());
}

#[test]
fn delays_in_a_tree_are_those_of_the_frame() {
    // 0 has three branches: a line of two at port 3, a fork at port 1, one at port 2.
    let tree = [None, Some((0, 3)), Some((1, 1)), Some((0, 1)), Some((3, 1)), Some((3, 2)), Some((0, 2))];
    let (latched, arrivals) = latch(&tree.map(node));
    assert_eq!(delays(&latched).unwrap(), arrivals.into_iter().map(Some).collect::<Vec<_>>());
}

#[test]
fn subdevices_without_clock_count_as_cable() {
    let mut nodes: Vec<_> = (0..5).map(|n: usize| node(n.checked_sub(1).map(|parent| (parent, 1)))).collect();
    nodes[0].has_clock = false;
    nodes[2].has_clock = false;
    let (latched, arrivals) = latch(&nodes);
    let since_first = |n: usize| Some(arrivals[n] - arrivals[1]);
    assert_eq!(delays(&latched).unwrap(), [None, Some(0), None, since_first(3), since_first(4)]);
}

#[test]
fn times_that_cannot_be_are_refused() {
    let nodes: Vec<_> = (0..3).map(|n: usize| node(n.checked_sub(1).map(|parent| (parent, 1)))).collect();
    let (latched, _) = latch(&nodes);
    let mut backwards = latched.clone();
    backwards[1].times_ns.as_mut().unwrap()[1] = backwards[1].times_ns.unwrap()[0].wrapping_sub(50);
    assert!(matches!(
        delays(&backwards),
        Err(DcError::BranchTooLong { position: 1, port: 1, .. })
            | Err(DcError::BranchTooShort { position: 0, .. })
    ));
    let mut short = latched;
    short[1].times_ns.as_mut().unwrap()[1] = short[1].times_ns.unwrap()[0].wrapping_add(5_000);
    assert!(matches!(delays(&short), Err(DcError::BranchTooShort { position: 0, port: 1, .. })));
}
