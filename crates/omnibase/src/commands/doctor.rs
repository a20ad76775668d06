//! `omnibase doctor`: is this machine fit for hard real time?

use crate::Outcome;
use crate::commands::scan;
use crate::target::{Manners, Target};
use anyhow::ensure;
use omnibase_host::doctor::{self, Change, Finding, How, Machine, Mend, MendError, Nic, Verdict};
use serde::Serialize;
use std::io::{self, Write};
use std::time::Duration;

/// Looks whether this machine is fit for hard real time: what it found, why it matters, and what mends it.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase doctor                     kernel, processors and rights
  omnibase doctor eth1                and the network interface of the drives
  sudo omnibase doctor eth1 --fix     mend what can be mended here and now; prints how to undo each change
  omnibase doctor eth1 --segment      and what hangs there: cables, ports, aliases, the shortest cycle
  omnibase doctor eth1 --json         for programs

Without --fix nothing is changed. Not while drives are enabled: the link may go down for a moment. Changes last until the next boot; docs/host.md says how to make them last.
Exit code 0 where nothing is bad (degraded is allowed), 1 where something is.")]
pub struct Arguments {
    /// The network interface of the drives.
    interface: Option<String>,
    /// Mend what is safe to mend: governor, throttling, huge pages, coalescing, offloads, EEE, interrupts. Needs root.
    #[arg(long)]
    fix: bool,
    /// Measure for so many seconds how long this machine pauses a program: virtual machines do for milliseconds.
    #[arg(long, value_name = "SECONDS", default_value = "2", value_parser = clap::value_parser!(u16).range(0..=3600))]
    pauses_s: u16,
    /// Look at the segment behind the interface too: cables, ports, order, aliases, the shortest cycle. Resets it to INIT: not
    /// while drives are enabled.
    #[arg(long, requires = "interface")]
    segment: bool,
    /// Print one JSON object: {"verdict", "findings", "changes"}.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let machine = Machine::default();
    let look = || {
        let nic = arguments.interface.as_deref().map(Nic::ask);
        doctor::examine(&machine, nic.as_ref())
    };
    let mut findings = look();
    let mut changes = Vec::new();
    if arguments.fix {
        ensure!(
            omnibase_host::is_root(),
            "--fix changes settings of the machine, which only root may do; nothing was changed. Run \
             `sudo omnibase doctor {}--fix`, or the commands that `omnibase doctor` prints",
            arguments.interface.as_ref().map_or_else(String::new, |name| format!("{name} "))
        );
        changes = mend(&findings, &machine);
        findings = look();
    }
    findings.push(doctor::pauses(Duration::from_secs(arguments.pauses_s.into())));
    if let Some(interface) = arguments.interface.as_ref().filter(|_| arguments.segment) {
        findings.extend(segment(interface));
    }
    let verdict = doctor::worst(&findings);
    if arguments.json {
        let page = Page::of(verdict, &findings, &changes);
        serde_json::to_writer_pretty(&mut *output, &page)?;
        writeln!(output)?;
    } else {
        print_changes(&changes, arguments.fix, output)?;
        print(&findings, output)?;
        print_verdict(&findings, output)?;
    }
    Ok(if verdict == Verdict::Bad { Outcome::Failed } else { Outcome::Done })
}

/// What `scan` sees of the segment that a person should do something about.
fn segment(interface: &str) -> Vec<Finding> {
    let target = Target::Interface(interface.to_owned());
    match scan::look(&target, Manners { force: false, visible: false }, false) {
        Ok((found, refusal)) => found_of(found, refusal.map(|error| error.to_string())),
        // What was found of the machine may be the reason.
        Err(error) => vec![doctor::no_segment(format!("{error:#}"))],
    }
}

/// What was found of a segment, and why it can't be set up, where it can't.
fn found_of(found: scan::Report, refusal: Option<String>) -> Vec<Finding> {
    let fit = found.cycle.map_or("its process data fit into none".to_owned(), |cycle| cycle.words);
    let mut findings = vec![doctor::segment_cycle(fit)];
    findings.extend(found.notes.into_iter().map(doctor::segment_note));
    let warnings = found.warnings.into_iter().filter(|warning| !found.left_out.contains(warning));
    findings.extend(warnings.chain(found.trouble).map(doctor::segment_trouble));
    findings.extend(found.left_out.iter().cloned().chain(refusal).map(doctor::not_set_up));
    findings
}

/// A change that was tried.
type Tried = (Mend, Result<Change, MendError>);

/// Makes every change that a program may make.
fn mend(findings: &[Finding], machine: &Machine) -> Vec<Tried> {
    let mends = findings.iter().filter_map(|finding| match &finding.remedy.as_ref()?.how {
        How::Now(mends) => Some(mends.iter()),
        How::ByHand(_) | How::WhileRunning => None,
    });
    mends.flatten().map(|mend| (mend.clone(), mend.apply(machine))).collect()
}

fn print_changes(changes: &[Tried], asked: bool, output: &mut dyn Write) -> io::Result<()> {
    if asked && changes.is_empty() {
        writeln!(output, "nothing to change: what is left needs a person\n")?;
    }
    for (mend, result) in changes {
        match result {
            Ok(change) => writeln!(output, "changed   {mend}\n   undo   {}", change.undo)?,
            Err(error) => writeln!(output, "FAILED    {mend}\n          {error}")?,
        }
    }
    if !changes.is_empty() {
        writeln!(output, "\nThe changes last until the next boot. What is found now:\n")?;
    }
    Ok(())
}

fn print(findings: &[Finding], output: &mut dyn Write) -> io::Result<()> {
    for finding in findings {
        let verdict = match finding.verdict {
            Verdict::Good => "good".to_owned(),
            other => other.name().to_uppercase(),
        };
        writeln!(output, "{verdict:<9} {:<25} {}", finding.check, finding.found)?;
        if finding.verdict == Verdict::Good {
            continue;
        }
        for (number, line) in wrapped(finding.why).iter().enumerate() {
            writeln!(output, "     {:<5} {line}", if number == 0 { "why" } else { "" })?;
        }
        if let Some(remedy) = &finding.remedy {
            // Not wrapped: to be copied.
            writeln!(output, "     mend  {}", remedy.command)?;
            match &remedy.how {
                How::ByHand(reason) => writeln!(output, "           by hand: {reason}")?,
                How::Now(_) => writeln!(output, "           --fix does it")?,
                How::WhileRunning => {
                    writeln!(output, "           only while it runs: there is nothing for --fix")?
                }
            }
        }
    }
    Ok(())
}

fn print_verdict(findings: &[Finding], output: &mut dyn Write) -> io::Result<()> {
    let count = |verdict| findings.iter().filter(|finding| finding.verdict == verdict).count();
    let words = match doctor::worst(findings) {
        Verdict::Good => "fit for hard real time",
        Verdict::Unknown => "fit as far as it can be seen",
        Verdict::Degraded => "usable; cycles will now and then be late",
        Verdict::Bad => "not fit",
    };
    writeln!(
        output,
        "\n{words}: {} good, {} unknown, {} degraded, {} bad",
        count(Verdict::Good),
        count(Verdict::Unknown),
        count(Verdict::Degraded),
        count(Verdict::Bad)
    )
}

/// Lines of at most 95 characters.
fn wrapped(text: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut().filter(|line| line.len() + word.len() < 95) {
            Some(line) => {
                line.push(' ');
                line.push_str(word);
            }
            None => lines.push(word.to_owned()),
        }
    }
    lines
}

/// All of it for programs.
#[derive(Serialize)]
struct Page<'a> {
    verdict: &'static str,
    findings: Vec<FindingJson<'a>>,
    changes: Vec<ChangeJson>,
}

#[derive(Serialize)]
struct FindingJson<'a> {
    check: &'static str,
    verdict: &'static str,
    found: &'a str,
    why: &'static str,
    mend: Option<&'a str>,
    /// `fix`, `run` (a run does it for itself), or `hand`; null where nothing mends it.
    by: Option<&'static str>,
}

#[derive(Serialize)]
struct ChangeJson {
    change: String,
    undo: Option<String>,
    error: Option<String>,
}

impl<'a> Page<'a> {
    fn of(verdict: Verdict, findings: &'a [Finding], changes: &[Tried]) -> Self {
        let finding = |finding: &'a Finding| FindingJson {
            check: finding.check,
            verdict: finding.verdict.name(),
            found: &finding.found,
            why: finding.why,
            mend: finding.remedy.as_ref().map(|remedy| remedy.command.as_str()),
            by: finding.remedy.as_ref().map(|remedy| match remedy.how {
                How::Now(_) => "fix",
                How::WhileRunning => "run",
                How::ByHand(_) => "hand",
            }),
        };
        let change = |(mend, result): &Tried| ChangeJson {
            change: mend.to_string(),
            undo: result.as_ref().ok().map(|change| change.undo.to_string()),
            error: result.as_ref().err().map(ToString::to_string),
        };
        Page {
            verdict: verdict.name(),
            findings: findings.iter().map(finding).collect(),
            changes: changes.iter().map(change).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Who is broken is in no cycle; a warning of a device that is set up is.
    #[test]
    fn a_segment_that_is_not_set_up_whole_is_bad() {
        let report = |warnings: &[&str], left_out: &[&str]| scan::Report {
            subdevices: Vec::new(),
            cycle: None,
            trouble: Vec::new(),
            notes: Vec::new(),
            warnings: warnings.iter().map(ToString::to_string).collect(),
            left_out: left_out.iter().map(ToString::to_string).collect(),
        };
        let told = |report, refusal: Option<&str>| -> Vec<(Verdict, String)> {
            let findings = found_of(report, refusal.map(str::to_owned));
            findings.into_iter().skip(1).map(|finding| (finding.verdict, finding.found)).collect()
        };
        let (odd, broken) = ("an odd SII", "SubDevice 0 is broken and left out: no valid firmware");
        let [odd_is, broken_is] = [(Verdict::Degraded, odd.to_owned()), (Verdict::Bad, broken.to_owned())];
        assert_eq!(told(report(&[odd, broken], &[broken]), None), [odd_is.clone(), broken_is]);
        let refused = (Verdict::Bad, "no".to_owned());
        assert_eq!(told(report(&[odd], &[]), Some("no")), [odd_is, refused]);
    }
}
