use super::*;
use crate::config::{DcConfig, Every, Timeouts};
use crate::mailbox::DEFAULT_TIMEOUT;
use crate::subdevice::{DcWidth, MailboxConfig, MemoryArea};
use crate::wire::frame::{DATAGRAM_OVERHEAD, FIRST_DATAGRAM, MAX_FRAME};
use crate::wire::{Address, Command};

fn area(sync_manager: u8, direction: Direction, bit_length: u32) -> Area {
    Area { sync_manager, direction, bit_length, packing: Packing::Bits }
}

fn member(position: u16, outputs: u32, inputs: u32) -> Member {
    let mut areas = Vec::new();
    if outputs > 0 {
        areas.push(area(2, Direction::Outputs, outputs));
    }
    if inputs > 0 {
        areas.push(area(3, Direction::Inputs, inputs));
    }
    let memory = MemoryArea { start: 0x1000, length: 256 };
    Member {
        position,
        station: 0x1000 + position,
        lrw: LrwPermission::Barred,
        areas,
        mailbox: Some(MailboxConfig {
            write: memory,
            read: memory,
            protocols: 4,
            answer_timeout: DEFAULT_TIMEOUT,
        }),
        every: Every::CYCLE,
        op_only: Vec::new(),
        clock: Some(DcWidth::Bits64),
        sync: DcConfig::Off,
        assign_activate: 0,
        timeouts: Timeouts::default(),
    }
}

fn members(count: u16, outputs: u32, inputs: u32) -> Vec<Member> {
    (0..count).map(|position| member(position, outputs, inputs)).collect()
}

fn allow(mut members: Vec<Member>) -> Vec<Member> {
    members.iter_mut().for_each(|member| member.lrw = LrwPermission::Allowed);
    members
}

const CLOCK: ClockUse = ClockUse::Distribute { reference: 0 };

fn commands(frame: &FramePlan) -> Vec<Command> {
    frame.datagrams.iter().map(|datagram| datagram.command).collect()
}

#[test]
fn three_servos_need_exactly_one_frame_with_four_datagrams_and_room_for_a_mailbox() {
    let plan = ImagePlan::new(&members(3, 200, 240), CLOCK).unwrap();
    assert_eq!(plan.frames.len(), 1);
    let frame = &plan.frames[0];
    assert_eq!(commands(frame), [Command::Frmw, Command::Lwr, Command::Lrd, Command::Brd]);
    let expected: Vec<u16> = frame.datagrams.iter().map(|datagram| datagram.expected).collect();
    assert_eq!(expected, [3, 3, 3, 3]);
    assert!(frame.carries_spare);
    assert_eq!(plan.spare_length, 256);
    assert_eq!((plan.outputs.length, plan.inputs.length), (75, 90));
}

#[test]
fn lrw_is_taken_only_where_every_subdevice_allows_it_and_counts_three() {
    let mut all = allow(members(3, 200, 240));
    let plan = ImagePlan::new(&all, CLOCK).unwrap();
    assert_eq!(commands(&plan.frames[0]), [Command::Frmw, Command::Lrw, Command::Brd]);
    let lrw = &plan.frames[0].datagrams[1];
    assert_eq!((lrw.length, lrw.expected), (90, 9));
    let offsets: Vec<_> = plan.placements.iter().map(|placement| placement.offset).collect();
    assert_eq!(offsets, [0, 0, 30, 30, 60, 60]);
    all[1].lrw = LrwPermission::Barred;
    let plan = ImagePlan::new(&all, CLOCK).unwrap();
    assert!(!commands(&plan.frames[0]).contains(&Command::Lrw));
}

#[test]
fn lrw_of_outputs_alone_counts_two_and_of_inputs_alone_one() {
    let mut all = allow(members(2, 8, 0));
    all.push(allow(vec![member(2, 0, 8)]).remove(0));
    let plan = ImagePlan::new(&all, ClockUse::None).unwrap();
    assert_eq!(plan.frames[0].datagrams[0].expected, 2 + 2 + 1);
}

#[test]
fn small_devices_share_a_byte_where_their_fmmus_map_bits() {
    let mut all = members(4, 4, 0);
    all[2].areas[0].bit_length = 2;
    all[3].areas[0].bit_length = 12;
    let plan = ImagePlan::new(&all, ClockUse::None).unwrap();
    let places: Vec<_> = plan.placements.iter().map(|p| (p.offset, p.logical.start_bit, p.bytes())).collect();
    assert_eq!(places, [(0, 0, 0..1), (0, 4, 0..1), (1, 0, 1..2), (2, 0, 2..4)]);
    for member in &mut all {
        member.areas[0].packing = Packing::Bytes;
    }
    let plan = ImagePlan::new(&all, ClockUse::None).unwrap();
    assert!(plan.placements.iter().all(|placement| placement.logical.start_bit == 0));
    assert_eq!(plan.outputs.length, 5);
}

#[test]
fn outputs_and_inputs_never_share_a_byte_of_the_address_space() {
    let plan = ImagePlan::new(&members(3, 3, 3), ClockUse::None).unwrap();
    assert_eq!(plan.inputs.start, plan.outputs.start + plan.outputs.length as u32);
}

#[test]
fn every_byte_is_carried_once_no_sync_manager_is_torn_and_counters_are_per_datagram() {
    for count in [1u16, 3, 20, 100, 333, 1000] {
        for all in [members(count, 17 * 8, 21 * 8), allow(members(count, 17 * 8, 21 * 8))] {
            let plan = ImagePlan::new(&all, CLOCK).unwrap();
            let (mut outputs, mut inputs) = (0, 0);
            let mut touched = 0;
            for frame in &plan.frames {
                let bytes: usize = frame.datagrams.iter().map(|d| d.length + DATAGRAM_OVERHEAD).sum();
                assert!(FIRST_DATAGRAM + bytes <= MAX_FRAME);
                assert!(frame.datagrams.len() >= 3, "indices carry the sequence number");
                for datagram in &frame.datagrams {
                    match datagram.role {
                        Role::Outputs { offset } => {
                            assert_eq!(offset, outputs);
                            outputs += datagram.length;
                            assert_eq!(datagram.length % 17, 0);
                            assert_eq!(usize::from(datagram.expected), datagram.length / 17);
                        }
                        Role::Inputs { offset } => {
                            assert_eq!(offset, inputs);
                            inputs += datagram.length;
                            assert_eq!(usize::from(datagram.expected), datagram.length / 21);
                        }
                        Role::Both { offset } => {
                            assert_eq!(offset, inputs);
                            inputs += datagram.length;
                            outputs += datagram.length;
                            assert_eq!(usize::from(datagram.expected), datagram.length / 21 * 3);
                        }
                        Role::Status => assert_eq!(datagram.expected, count),
                        _ => {}
                    }
                    touched += datagram.touches.len();
                }
            }
            assert_eq!((outputs, inputs), (plan.outputs.length, plan.inputs.length));
            let times = if plan.transport == Transport::Combined { 1 } else { 2 };
            assert_eq!(touched, usize::from(count) * times);
            // No more frames than bytes need, one SyncManager's length of slack per frame.
            let data: usize = plan.frames.iter().flat_map(|f| &f.datagrams).map(|d| d.length).sum();
            assert!(plan.frames.len() <= 1 + data / (MAX_FRAME - 100), "{count}: {}", plan.frames.len());
        }
    }
}

#[test]
fn a_sync_manager_longer_than_a_frame_is_carried_in_parts_that_each_count() {
    let plan = ImagePlan::new(&members(1, 8 * 4000, 8), ClockUse::None).unwrap();
    let parts: Vec<_> =
        plan.frames.iter().flat_map(|f| &f.datagrams).filter(|d| d.command == Command::Lwr).collect();
    assert_eq!(parts.iter().map(|part| part.length).sum::<usize>(), 4000);
    assert!(parts.iter().all(|part| part.expected == 1));
    let mut next = LOGICAL_START;
    for part in parts {
        assert_eq!(part.address, Address::Logical(next));
        next += part.length as u32;
    }
}

#[test]
fn no_subdevices_need_no_frame_and_couplers_only_need_the_status() {
    assert_eq!(ImagePlan::new(&[], ClockUse::None).unwrap().frames.len(), 0);
    let plan = ImagePlan::new(&members(2, 0, 0), ClockUse::None).unwrap();
    assert_eq!(commands(&plan.frames[0]), [Command::Brd, Command::Nop, Command::Nop]);
}

#[test]
fn refusals_name_what_is_missing() {
    let error = ImagePlan::new(&members(1, 8, 8), ClockUse::Distribute { reference: 7 }).unwrap_err();
    assert_eq!(error, PlanError::NoReferenceClock { position: 7 });
    let error = ImagePlan::new(&members(1000, 8000, 8000), ClockUse::None).unwrap_err();
    assert!(matches!(error, PlanError::TooManyFrames { limit: MAX_FRAMES, .. }));
}

#[test]
fn a_32_bit_reference_clock_is_distributed_with_four_bytes_and_steering_adds_a_write() {
    let mut all = members(2, 8, 8);
    all[0].clock = Some(DcWidth::Bits32);
    let plan = ImagePlan::new(&all, ClockUse::Steer { reference: 0 }).unwrap();
    let first: Vec<_> = plan.frames[0].datagrams.iter().take(2).map(|d| (d.command, d.length)).collect();
    assert_eq!(first, [(Command::Fpwr, 4), (Command::Frmw, 4)]);
}

fn slow(mut member: Member, every: u16) -> Member {
    member.every = Every::nth(every).unwrap();
    member
}

/// Frames that go in a cycle, and the bytes of their datagrams.
fn going(plan: &ImagePlan, cycle: u64) -> (usize, usize) {
    let due = plan.frames.iter().filter(|frame| frame.turn.is_due(cycle));
    let bytes = |frame: &FramePlan| frame.datagrams.iter().map(|one| one.length).sum::<usize>();
    due.fold((0, 0), |(frames, all), frame| (frames + 1, all + bytes(frame)))
}

#[test]
fn slow_ones_are_spread_over_the_cycles_and_counted_where_they_go() {
    let mut all = members(3, 200, 240);
    all.extend((3..11).map(|position| slow(member(position, 64, 64), 4)));
    all.extend((11..14).map(|position| slow(member(position, 3, 5), 6)));
    let plan = ImagePlan::new(&all, CLOCK).unwrap();
    // Two of eight in each of four phases; three of the others where the fewest bytes of them go.
    for cycle in 0..24 {
        assert!(going(&plan, cycle).0 <= 3, "cycle {cycle}: {:?}", going(&plan, cycle));
    }
    let all_day: usize = (0..12).map(|cycle| going(&plan, cycle).0).sum();
    assert_eq!(all_day, 12 + 4 * 3 + 3 * 2);
    assert_eq!(plan.frames[0].turn, Turn::EACH_CYCLE);
    let spare = plan.frames.iter().find(|frame| frame.carries_spare).unwrap();
    assert_eq!(spare.turn, Turn::EACH_CYCLE);
    for frame in &plan.frames {
        for datagram in frame.datagrams.iter().filter(|one| !one.touches.is_empty()) {
            let turn = |position: u16| plan.turns[usize::from(position)];
            assert!(datagram.touches.iter().all(|touch| turn(touch.position) == frame.turn));
            assert_eq!(usize::from(datagram.expected), datagram.touches.len());
        }
    }
    // No byte is of two turns, also where bits are mapped.
    let bytes: Vec<_> =
        plan.placements.iter().map(|one| (one.direction, one.bytes(), one.position)).collect();
    for (way, bytes_of, one) in &bytes {
        for (other_way, others, other) in &bytes {
            let same_turn = plan.turns[usize::from(*one)] == plan.turns[usize::from(*other)];
            assert!(
                same_turn || way != other_way || bytes_of.end <= others.start || others.end <= bytes_of.start
            );
        }
    }
}

#[test]
fn slow_ones_make_the_shortest_cycle_shorter() {
    let fit = |every: u16| {
        let mut all = members(3, 200, 240);
        all.extend((3..63).map(|position| slow(member(position, 400, 400), every)));
        ImagePlan::new(&all, CLOCK).unwrap().fit(all.len(), None)
    };
    let (fast, slow) = (fit(1), fit(10));
    assert_eq!((fast.frames, slow.frames), (5, 2));
    assert!(slow.wire < fast.wire / 2, "{slow} against {fast}");
    // Rates without a common divisor meet in some cycle.
    let mut all = members(1, 8, 8);
    all.extend([(1, 2), (2, 3), (3, 5)].map(|(position, every)| slow_of(position, every)));
    assert_eq!(ImagePlan::new(&all, CLOCK).unwrap().fit(all.len(), None).frames, 4);
}

fn slow_of(position: u16, every: u16) -> Member {
    slow(member(position, 8, 8), every)
}

/// FMMUs that are left of the start before see none of it.
#[test]
fn process_data_of_the_next_start_stand_elsewhere() {
    let mut all = members(2, 4, 4);
    let first = ImagePlan::new(&all, ClockUse::None).unwrap();
    all.iter_mut().for_each(|member| member.station = 0x1003 + member.position);
    let next = ImagePlan::new(&all, ClockUse::None).unwrap();
    assert_eq!((first.outputs.start, next.outputs.start), (0x0001_0000, 0x0003_0000));
    let offsets = |plan: &ImagePlan| plan.placements.iter().map(|one| one.offset).collect::<Vec<_>>();
    assert_eq!(offsets(&first), offsets(&next));
}
