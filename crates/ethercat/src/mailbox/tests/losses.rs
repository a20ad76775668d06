//! What is lost, comes twice, comes late or comes unasked.

use super::*;

#[test]
fn any_one_datagram_lost_or_refused_leaves_the_right_result() {
    for fate in [Fate::LostBefore, Fate::LostAfter, Fate::Refused] {
        for bad in 0..40 {
            let (mut mailbox, mut server) = (mailbox(), Server::new());
            let mut unlucky = |number| if number == bad { fate } else { Fate::Arrives };
            let request = MailboxRequest::download(object(0x2000), value(150));
            let (down, _) = run_with(&mut mailbox, &mut server, request, &mut unlucky);
            assert_eq!(
                (down.result, &server.objects[&0x2000]),
                (Ok(()), &value(150)),
                "down, datagram {bad}"
            );
            let (up, _) = run_with(&mut mailbox, &mut server, upload(0x2000, 150), &mut unlucky);
            assert_eq!((up.result, up.request.data), (Ok(()), value(150)), "up, datagram {bad}");
            let list = MailboxRequest::new(Operation::List(ObjectList::All), Vec::with_capacity(400));
            let (list, _) = run_with(&mut mailbox, &mut server, list, &mut unlucky);
            assert_eq!((list.result, list.request.data.len()), (Ok(()), 200), "list, datagram {bad}");
        }
    }
}

#[test]
fn a_lost_answer_is_asked_for_again_and_a_repeat_is_recognised() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, value(100));
    // Datagrams: look, write, poll, read. The read is lost behind the SubDevice.
    let (up, _) = run_with(&mut mailbox, &mut server, upload(0x2000, 100), |number| {
        if number == 3 { Fate::LostAfter } else { Fate::Arrives }
    });
    assert_eq!((up.result, up.request.data), (Ok(()), value(100)));
    assert_eq!(mailbox.counters().repeats, 1);
    // The second read is lost before the SubDevice: it gives the answer before that again, which is known.
    let (up, _) = run_with(&mut mailbox, &mut server, upload(0x2000, 100), |number| {
        if number == 3 { Fate::LostBefore } else { Fate::Arrives }
    });
    assert_eq!((up.result, up.request.data), (Ok(()), value(100)));
    assert_eq!((mailbox.counters().repeats, mailbox.counters().duplicate), (2, 1));
}

#[test]
fn emergencies_strays_and_other_protocols_do_not_disturb_a_transfer() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, value(100));
    // An emergency, an answer for another object, one of another service, EoE, and a header that lies.
    server.send(3, &[0x00, 0x10, 0x20, 0xFF, 0x01, 1, 2, 3, 4, 5]);
    server.send(3, &[0x00, 0x30, 0x43, 0x01, 0x20, 0x00, 9, 9, 9, 9]);
    server.send(3, &[0x00, 0x80, 0x02, 0, 0, 0, 1, 0]);
    server.send(2, &[1, 2, 3]);
    server.outbox.push_back([vec![0xFF; 6], vec![0; 58]].concat());
    let up = run(&mut mailbox, &mut server, upload(0x2000, 100));
    assert_eq!((up.result, up.request.data), (Ok(()), value(100)));
    assert_eq!(mailbox.counters().stray, 4);
    let emergency = mailbox.emergencies().take().unwrap().emergency;
    assert_eq!((emergency.code, emergency.register, emergency.data), (0xFF20, 1, [1, 2, 3, 4, 5]));
}

#[test]
fn an_emergency_between_request_and_answer_does_not_end_the_request() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, vec![1, 2]);
    server.mangle = Box::new(|number, data| {
        if number == 0 { Some(vec![0x00, 0x10, 0x20, 0xFF, 0x01, 1, 2, 3, 4, 5]) } else { Some(data) }
    });
    let mut request = upload(0x2000, 4);
    request.timeout = Some(Duration::from_millis(5));
    let up = run(&mut mailbox, &mut server, request);
    assert!(matches!(up.result, Err(MailboxError::Timeout { waiting: Waiting::Answer, .. })));
    assert_eq!(mailbox.emergencies().len(), 1);
}

#[test]
fn the_emergency_ring_counts_what_it_drops() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    for n in 0..20 {
        server.send(3, &[0x00, 0x10, n, 0xFF, 0x01, 0, 0, 0, 0, 0]);
    }
    server.objects.insert(0x2000, vec![1]);
    run(&mut mailbox, &mut server, upload(0x2000, 4));
    assert_eq!((mailbox.emergencies().len(), mailbox.emergencies().dropped()), (16, 4));
    assert_eq!(mailbox.emergencies().take().unwrap().emergency.code, 0xFF04);
}

#[test]
fn a_subdevice_that_vanishes_between_segments_times_out() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, value(1000));
    mailbox.start(upload(0x2000, 1000).with_timeout(Duration::from_millis(50)), HostTime(0)).unwrap();
    let mut now = HostTime(0);
    let done = loop {
        now = now + Duration::from_micros(50);
        assert!(now < HostTime(200_000_000), "still busy after 200 ms");
        match mailbox.next(now) {
            Next::Done(done) => break done.unwrap(),
            Next::WaitUntil(_) => {}
            Next::Send(request) => {
                server.gone = server.answers >= 2;
                let mut data = vec![0; request.length];
                mailbox.fill(&mut data);
                let working_counter = server.datagram(request, &mut data);
                mailbox.answer(Answer::Returned { working_counter, data: &data }, now);
            }
        }
    };
    assert_eq!(done.result, Err(MailboxError::Unreachable { after: Duration::from_millis(50) }));
}

/// Frames that don't come back are no silence of the SubDevice, whenever they begin to.
#[test]
fn lost_frames_are_told_as_such_and_soon() {
    for lost_from in [0, 1, 2, 3, 5] {
        let (mut mailbox, mut server) = (mailbox(), Server::new());
        server.objects.insert(0x2000, value(1000));
        mailbox.start(upload(0x2000, 1000), HostTime(0)).unwrap();
        let (mut now, mut asked) = (HostTime(0), 0);
        let done = loop {
            now = now + Duration::from_millis(1);
            match mailbox.next(now) {
                Next::Done(done) => break done.unwrap(),
                Next::WaitUntil(_) => {}
                Next::Send(request) => {
                    let mut data = vec![0; request.length];
                    mailbox.fill(&mut data);
                    if asked >= lost_from {
                        mailbox.answer(Answer::Lost, now);
                    } else {
                        let working_counter = server.datagram(request, &mut data);
                        mailbox.answer(Answer::Returned { working_counter, data: &data }, now);
                    }
                    asked += 1;
                }
            }
        };
        assert_eq!(done.result, Err(MailboxError::Unheard { after: Duration::from_millis(500) }));
        assert!(now < HostTime(600_000_000), "{now:?}");
    }
    // A shorter time-out of its own is over sooner.
    let mut mailbox = mailbox();
    mailbox.start(upload(0x2000, 1000).with_timeout(Duration::from_millis(20)), HostTime(0)).unwrap();
    let mut now = HostTime(0);
    let done = loop {
        now = now + Duration::from_millis(1);
        match mailbox.next(now) {
            Next::Done(done) => break done.unwrap(),
            Next::WaitUntil(_) => {}
            Next::Send(_) => mailbox.answer(Answer::Lost, now),
        }
    };
    assert!(matches!(done.result, Err(MailboxError::Unheard { .. })), "{:?}", done.result);
}

#[test]
fn a_silent_server_times_out_and_is_told() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, value(2));
    server.mangle = Box::new(|_, _| None);
    let up = run(&mut mailbox, &mut server, upload(0x2000, 4).with_timeout(Duration::from_millis(20)));
    let after = Duration::from_millis(20);
    assert_eq!(up.result, Err(MailboxError::Timeout { waiting: Waiting::Answer, after }));
    assert_eq!(server.received.last().unwrap()[6..10], 0x0504_0000u32.to_le_bytes());
}

#[test]
fn any_bytes_end_in_a_result_without_growing_the_buffer() {
    // xorshift64*, seed 1: answers of random length and content, some of them close to right ones.
    let mut state = 1u64;
    let mut random = move || {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        (state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 32) as u32
    };
    for round in 0..3000 {
        let (mut mailbox, mut server) = (mailbox(), Server::new());
        server.objects.insert(0x2000, value(120));
        let flips = random() % 4;
        let mut seeds: Vec<u32> = (0..64).map(|_| random()).collect();
        server.mangle = Box::new(move |_, mut data| {
            for _ in 0..flips {
                let seed = seeds.pop().unwrap_or(0);
                let at = seed as usize % data.len();
                data[at] = (seed >> 16) as u8;
            }
            Some(data)
        });
        let operation = match round % 4 {
            0 => Operation::Upload { object: object(0x2000), access: SdoAccess::Entry },
            1 => Operation::Download { object: object(0x2000), access: SdoAccess::Entry },
            2 => Operation::List(ObjectList::All),
            _ => Operation::DescribeEntry { object: object(0x2000), value_info: 0x78 },
        };
        let buffer = if round % 4 == 1 { value(120) } else { Vec::with_capacity(120) };
        let request = MailboxRequest::new(operation, buffer).with_timeout(Duration::from_millis(3));
        let done = run(&mut mailbox, &mut server, request);
        assert!(done.request.data.capacity() <= 120);
        let _ = EntryDescription::read(&done.request.data);
    }
}

#[test]
fn a_reset_ends_the_request_in_hand_and_the_counter_begins_anew() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, vec![1]);
    run(&mut mailbox, &mut server, upload(0x2000, 4));
    mailbox.start(upload(0x2000, 4), HostTime(0)).unwrap();
    assert!(mailbox.start(upload(0x2000, 4), HostTime(0)).is_err());
    mailbox.reset();
    let Next::Done(Some(done)) = mailbox.next(HostTime(0)) else { panic!("not over") };
    assert_eq!(done.result, Err(MailboxError::Reset));
    assert_eq!(mailbox.next(HostTime(0)), Next::Done(None));
    let mut fresh = Server::new();
    fresh.objects.insert(0x2000, vec![1]);
    assert_eq!(run(&mut mailbox, &mut fresh, upload(0x2000, 4)).result, Ok(()));
}

#[test]
fn a_cancelled_request_leaves_the_message_counter_so_that_the_next_is_no_repeat() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, vec![1]);
    run(&mut mailbox, &mut server, upload(0x2000, 4));
    mailbox.start(upload(0x2000, 4), HostTime(0)).unwrap();
    mailbox.cancel();
    let Next::Done(Some(done)) = mailbox.next(HostTime(0)) else { panic!("not over") };
    assert_eq!(done.result, Err(MailboxError::Reset));
    assert_eq!(run(&mut mailbox, &mut server, upload(0x2000, 4)).result, Ok(()));
}
