//! Where ROS 2's wishes meet the robot: one thread that waits for nothing but what comes.

use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use omnibase_client::{Heard, Seat};
use rustdds::mio1::{Events, Interest, Poll, Token};

use crate::actions::{Actions, Situation};
use crate::clock::Clock;
use crate::command::{Commands, Wish};
use crate::loud::Loud;
use crate::news::News;
use crate::node::Ros;
use crate::parameters::Parameters;
use crate::poses::PosesIn;
use crate::services::Services;
use crate::watch;

/// The longest wait for something that comes.
const LOOK: Duration = Duration::from_millis(5);
/// After so long without a turn, what waits is of unknown age.
const GAP: Duration = Duration::from_millis(100);
/// A wish is said to the robot again so often, while it counts.
const RENEW: Duration = Duration::from_millis(20);
/// The bridge says so often that it lives.
const LIVE: Duration = Duration::from_millis(100);
/// DDS's threads are looked for so often.
const WATCH: Duration = Duration::from_millis(100);

/// All that the thread holds.
pub struct Bridge {
    /// The node.
    pub ros: Ros,
    /// The seat at the robot.
    pub seat: Seat,
    /// `cmd_vel`.
    pub commands: Commands,
    /// The clock.
    pub clock: Clock,
    /// What changes seldom.
    pub news: News,
    /// What is asked by a service.
    pub services: Services,
    /// The robot's settings.
    pub parameters: Parameters,
    /// What takes its time.
    pub actions: Actions,
    /// Names of the robot's values.
    pub columns: Vec<String>,
    /// Poses that come in.
    pub poses: PosesIn,
    /// Why the other thread ended, where it did.
    pub ended: Receiver<anyhow::Error>,
}

/// What is driven now.
#[derive(Default)]
struct Drive {
    wish: Option<Wish>,
    said: Option<Instant>,
    /// Whether the robot said how it stands: before that nobody knows whether the stick may drive.
    is_told: bool,
}

impl Bridge {
    /// Goes on until something is lost; why.
    pub fn work(mut self) -> anyhow::Result<()> {
        let (mut poll, mut events) = (Poll::new()?, Events::with_capacity(16));
        poll.registry().register(self.commands.source(), Token(0), Interest::READABLE)?;
        let (mut drive, mut loud) = (Drive::default(), Loud::default());
        let (mut turned, mut watched, mut lived) = (Instant::now(), Instant::now(), Instant::now());
        let mut situation = None;
        loop {
            match poll.poll(&mut events, Some(LOOK)) {
                Err(error) if error.kind() != std::io::ErrorKind::Interrupted => return Err(error.into()),
                _ => {}
            }
            let now = Instant::now();
            let waited = now.saturating_duration_since(turned) > GAP;
            turned = now;
            if waited || now.saturating_duration_since(watched) > WATCH {
                watched = now;
                if let Some(thread) = watch::lost_thread() {
                    anyhow::bail!(
                        "DDS's thread `{thread}` is gone (a SIGSTOP and SIGCONT end it): the bridge begins anew"
                    );
                }
            }
            if let Ok(error) = self.ended.try_recv() {
                return Err(error.context("following the robot"));
            }
            self.hear_commands(&mut drive, &mut loud, now, waited);
            self.drive(&mut drive, &mut loud, now)?;
            let phase = situation.as_ref().map_or("", |situation: &Situation| situation.phase.as_str());
            self.services.take(&mut self.seat, phase, self.parameters.path_name())?;
            self.parameters.take(&mut self.seat)?;
            let mut refused = self.poses.take(&mut self.seat, &self.clock, now)?;
            if let Some(situation) = &situation {
                refused.extend(self.actions.take(&mut self.seat, situation)?);
            }
            for words in refused {
                if let Some(words) = loud.say("asked", || words, now) {
                    self.ros.warn(&words);
                }
            }
            if drive.said.is_none() && now.saturating_duration_since(lived) > LIVE {
                lived = now;
                // One that came too late doesn't count as let go.
                self.seat.let_go()?;
            }
            if let Some(said) = self.hear_robot(&mut loud, now)? {
                drive.is_told = true;
                self.actions.look(&said);
                situation = Some(said);
            }
        }
    }

    fn hear_commands(&mut self, drive: &mut Drive, loud: &mut Loud, now: Instant, waited: bool) {
        let (wish, mut refusals) = self.commands.newest(self.clock.now_ns(), now, waited);
        if let Some(objection) = self.commands.objection(now) {
            drive.wish = None;
            refusals.push(objection);
        } else if wish.is_some() {
            drive.wish = wish;
            // A new wish waits for nothing.
            drive.said = drive.said.map(|_| now - RENEW);
        } else if !refusals.is_empty() {
            drive.wish = None;
        }
        for refusal in refusals {
            let expected = self.commands.expected();
            if let Some(words) = loud.say(refusal.kind(), || refusal.words(expected), now) {
                self.ros.warn(&words);
            }
        }
    }

    /// Says the wish to the robot while it counts, and lets go where none does.
    fn drive(&mut self, drive: &mut Drive, loud: &mut Loud, now: Instant) -> anyhow::Result<()> {
        drive.wish = drive.wish.filter(|wish| now < wish.until);
        let is_due = |said: Option<Instant>, every| {
            said.is_none_or(|said| now.saturating_duration_since(said) >= every)
        };
        match drive.wish {
            Some(wish) if is_due(drive.said, RENEW) => {
                if !drive.is_told {
                    return Ok(());
                }
                match self.seat.drive(wish.twist, wish.frame, now) {
                    Err(omnibase_client::Error::Stopped(why)) => {
                        drive.said = None;
                        let words = || {
                            format!(
                                "cmd_vel moves nothing: the robot was stopped ({why}); the service `enable` lets it drive again"
                            )
                        };
                        if let Some(words) = loud.say("stopped", words, now) {
                            self.ros.warn(&words);
                        }
                    }
                    said => {
                        said?;
                        drive.said = Some(now);
                    }
                }
            }
            Some(_) => {}
            None if drive.said.take().is_some() => self.seat.let_go()?,
            None => {}
        }
        Ok(())
    }

    /// Hears what the robot says; how it stands, where it says that.
    fn hear_robot(&mut self, loud: &mut Loud, now: Instant) -> anyhow::Result<Option<Situation>> {
        let mut situation = None;
        while let Some(heard) = self.seat.hear(Duration::ZERO)? {
            match heard {
                Heard::Answer(answer) => {
                    let is_heard = self.services.answer(&answer)
                        || self.parameters.answer(&answer)
                        || self.actions.answer(&mut self.seat, &answer)?;
                    let is_loud = !is_heard && !answer.done;
                    let words = || format!("the robot refuses: {}", answer.text);
                    if let Some(words) = is_loud.then(|| loud.say("answer", words, now)).flatten() {
                        self.ros.warn(&words);
                    }
                }
                Heard::Status(status) => {
                    self.parameters.told(&status["settings"]);
                    let commands = &mut self.commands;
                    self.news.tell(&status, &self.clock, || {
                        let objection =
                            commands.objection(now).map(|refusal| refusal.words(commands.expected()));
                        (commands.publishers(), objection)
                    });
                    situation = Situation::of(&status, &self.columns);
                }
            }
        }
        Ok(situation)
    }
}
