//! From the engine's events to progress messages: throttled, with an estimate of the whole.

use crate::convert::to_proto;
use remesh_engine::pipeline::{Event, Progress};
use remesh_engine::stage::{Stage, Subject};
use remesh_proto::v1;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Shortest time between two messages about stages that are not done.
const INTERVAL: Duration = Duration::from_millis(100);

/// About how much of a cold run each stage takes, in percent. Only for the bar that a person looks at.
fn share(stage: Stage) -> f64 {
    match stage {
        Stage::Import => 5.0,
        Stage::Topology
        | Stage::SearchTree
        | Stage::Features
        | Stage::Cut
        | Stage::Patches
        | Stage::Size
        | Stage::Metric
        | Stage::Curve
        | Stage::System => 1.0,
        Stage::Curvature | Stage::Proximity | Stage::Thickness | Stage::Centerline => 1.0,
        Stage::Partition => 10.0,
        Stage::Factor => 6.0,
        Stage::Boundary | Stage::Solve => 4.0,
        Stage::Chart => 3.0,
        Stage::Planar => 25.0,
        Stage::Interior => 15.0,
        Stage::Lift => 2.0,
        Stage::Assembly => 2.0,
        Stage::Optimize => 10.0,
        Stage::Quads => 20.0,
        Stage::Quality => 5.0,
    }
}

#[derive(Default)]
struct Counts {
    /// Finished subjects and highest subject seen, by stage.
    stages: HashMap<Stage, (u32, u32)>,
    total: f64,
    last: Option<Instant>,
}

/// Turns events into messages.
pub(crate) struct Meter {
    send: Box<dyn Fn(v1::Progress) + Send + Sync>,
    counts: Mutex<Counts>,
}

impl Meter {
    /// A meter that hands its messages to `send`, which must not block.
    pub(crate) fn new(send: impl Fn(v1::Progress) + Send + 'static) -> Self {
        let send = Mutex::new(send);
        let send = Box::new(move |progress| (send.lock().unwrap_or_else(PoisonError::into_inner))(progress));
        Meter { send, counts: Mutex::default() }
    }

    /// Takes an event, from any thread.
    pub(crate) fn on(&self, event: &Event) {
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        let (fraction, outcome) = match event.progress {
            Progress::Started => (0.0, v1::StageOutcome::Unspecified),
            Progress::Fraction(done) => (done.clamp(0.0, 1.0), v1::StageOutcome::Unspecified),
            Progress::Finished(record) => (1.0, to_proto::outcome(record.outcome)),
        };
        let finished = matches!(event.progress, Progress::Finished(_));
        counts.advance(event, fraction, finished);
        let now = Instant::now();
        if !finished && counts.last.is_some_and(|last| now.duration_since(last) < INTERVAL) {
            return;
        }
        counts.last = Some(now);
        (self.send)(v1::Progress {
            stage: event.stage.name().to_owned(),
            subject: to_proto::subject(event.subject),
            fraction,
            outcome: outcome.into(),
            total_fraction: counts.total,
        });
    }
}

impl Counts {
    fn advance(&mut self, event: &Event, fraction: f64, finished: bool) {
        let number = match event.subject {
            Subject::Surface => 0,
            Subject::Patch(n) | Subject::Curve(n) => n,
        };
        let (done, seen) = self.stages.entry(event.stage).or_default();
        *seen = (*seen).max(number + 1);
        *done += u32::from(finished);
        let local = if *seen == 1 { fraction } else { f64::from(*done) / f64::from((*seen).max(*done)) };
        let before: f64 = Stage::ALL.iter().take_while(|&&s| s != event.stage).map(|&s| share(s)).sum();
        let whole: f64 = Stage::ALL.iter().map(|&s| share(s)).sum();
        self.total = self.total.max((before + share(event.stage) * local) / whole).min(1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use remesh_engine::stage::{Outcome, StageRecord};
    use std::sync::Arc;

    #[test]
    fn the_whole_never_goes_back_and_ends_of_stages_are_always_told() {
        let seen = Arc::new(Mutex::new(Vec::new()));
        let sink = seen.clone();
        let meter = Meter::new(move |p| sink.lock().expect("lock").push(p));
        for stage in Stage::ALL {
            for patch in 0..20 {
                let subject = Subject::Patch(patch);
                let record = StageRecord { stage, subject, outcome: Outcome::Run, milliseconds: 1.0, bytes: 1 };
                for progress in [Progress::Started, Progress::Fraction(0.5), Progress::Finished(record)] {
                    meter.on(&Event { stage, subject, progress });
                }
            }
        }
        let seen = seen.lock().expect("lock");
        let ends = seen.iter().filter(|p| p.outcome == i32::from(v1::StageOutcome::Run)).count();
        assert_eq!(ends, Stage::ALL.len() * 20);
        assert!(seen.len() < 2 * ends, "started and fraction are throttled");
        assert!(seen.windows(2).all(|w| w[0].total_fraction <= w[1].total_fraction));
        assert!((seen[seen.len() - 1].total_fraction - 1.0).abs() < 1e-12);
    }
}
