//! What happens to a session, for those who watch it: a bounded ring of numbered events. Writers never wait for readers.

use crate::config::Clock;
use crate::convert::to_proto;
use crate::dispatch::too_late;
use crate::status::status_of;
use crate::stream::Watch;
use remesh_engine::work::CancelToken;
use remesh_proto::v1;
use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use v1::watch_session_response::Event;

/// Events of stages that are kept for a session: about what one remesh of many patches tells.
const KEPT_STAGE_EVENTS: usize = 1024;
/// Other events that are kept; apart, so that a chatty stage pushes no revision out.
const KEPT_OTHER_EVENTS: usize = 256;
/// Events on their way to a reader, beside what the transport buffers.
const IN_FLIGHT: usize = 64;
/// Shortest time between two bursts to a reader: events that come together travel in one frame. Transports cut connections on which many
/// small frames pile up, and other calls with them.
const PACE: Duration = Duration::from_millis(20);

#[derive(Debug, Default)]
struct Ring {
    /// Kept events by number.
    events: BTreeMap<u64, v1::WatchSessionResponse>,
    stages: VecDeque<u64>,
    others: VecDeque<u64>,
    /// Number of the last event; 0 before the first.
    last: u64,
    /// Number of the last event that was dropped and is none of a stage.
    dropped_other: u64,
    closed: bool,
}

/// The events of a session.
#[derive(Debug)]
pub(crate) struct Feed {
    ring: Mutex<Ring>,
    /// Number of the last event, for those who wait for the next.
    last: watch::Sender<u64>,
    clock: Clock,
}

/// Where a reader begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Start {
    /// With the next event.
    Now,
    /// After an event.
    AfterSequence(u64),
    /// After a revision was made.
    AfterRevision(u64),
}

/// How far a reader is.
#[derive(Debug)]
struct Cursor {
    /// Number of the event that is wanted next.
    next: u64,
    without_stages: bool,
    /// Something was missed before, nobody knows how much.
    lagged: bool,
}

fn is_stage(event: &v1::WatchSessionResponse) -> bool {
    matches!(event.event, Some(Event::StageMoved(_)))
}

impl Feed {
    /// A feed without events.
    pub(crate) fn new(clock: Clock) -> Self {
        Feed { ring: Mutex::default(), last: watch::Sender::new(0), clock }
    }

    /// The time.
    pub(crate) fn now(&self) -> std::time::SystemTime {
        self.clock.now()
    }

    fn ring(&self) -> MutexGuard<'_, Ring> {
        self.ring.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an event. Never waits; after the end of the session it does nothing.
    pub(crate) fn push(&self, revision: u64, event: Event) {
        let mut ring = self.ring();
        if ring.closed {
            return;
        }
        ring.closed = matches!(event, Event::SessionClosed(_));
        ring.last += 1;
        let sequence = ring.last;
        let time = Some(to_proto::time(self.clock.now()));
        let message = v1::WatchSessionResponse { sequence, time, revision, event: Some(event) };
        if is_stage(&message) {
            ring.stages.push_back(sequence);
            if ring.stages.len() > KEPT_STAGE_EVENTS
                && let Some(oldest) = ring.stages.pop_front()
            {
                ring.events.remove(&oldest);
            }
        } else {
            ring.others.push_back(sequence);
            if ring.others.len() > KEPT_OTHER_EVENTS
                && let Some(oldest) = ring.others.pop_front()
            {
                ring.events.remove(&oldest);
                ring.dropped_other = oldest;
            }
        }
        ring.events.insert(sequence, message);
        drop(ring);
        self.last.send_replace(sequence);
    }

    /// Tells that the session is over.
    pub(crate) fn close(&self, revision: u64, reason: v1::SessionEnd) {
        self.push(revision, Event::SessionClosed(v1::SessionClosed { reason: reason.into() }));
    }

    fn cursor(&self, start: Start, without_stages: bool) -> Cursor {
        let ring = self.ring();
        let at = |next, lagged| Cursor { next, without_stages, lagged };
        match start {
            // Who comes after the end is told of it.
            _ if ring.closed => at(ring.last, false),
            Start::Now => at(ring.last + 1, false),
            Start::AfterSequence(n) if n <= ring.last => at(n + 1, false),
            Start::AfterSequence(_) => at(ring.last + 1, true),
            Start::AfterRevision(0) => at(1, false),
            Start::AfterRevision(r) => {
                let made = |e: &v1::WatchSessionResponse| matches!(e.event, Some(Event::RevisionMade(_)));
                let mut revisions = ring.events.values().filter(|e| made(e) && e.revision >= r);
                match revisions.next() {
                    Some(event) if event.revision == r => at(event.sequence + 1, false),
                    Some(event) => at(event.sequence, true),
                    None => at(ring.last + 1, true),
                }
            }
        }
    }

    /// The next event of a reader, if there is one.
    fn next(&self, cursor: &mut Cursor) -> Option<v1::WatchSessionResponse> {
        let ring = self.ring();
        let mut rest = ring.events.range(cursor.next..).map(|(_, event)| event);
        let found = if cursor.without_stages { rest.find(|e| !is_stage(e)) } else { rest.next() };
        let (missed, before) = match found {
            // Which of the dropped events were of stages is not known any more.
            _ if cursor.lagged => (Some(0), found.map_or(ring.last, |e| e.sequence - 1)),
            Some(event) if cursor.without_stages => ((ring.dropped_other >= cursor.next).then_some(0), event.sequence - 1),
            Some(event) => ((event.sequence > cursor.next).then(|| event.sequence - cursor.next), event.sequence - 1),
            None => return None,
        };
        if let Some(missed) = missed {
            (cursor.lagged, cursor.next) = (false, before + 1);
            let lagged = Event::Lagged(v1::Lagged { missed });
            let (time, revision) = found.map_or((Some(to_proto::time(self.clock.now())), 0), |e| (e.time, e.revision));
            return Some(v1::WatchSessionResponse { sequence: before, time, revision, event: Some(lagged) });
        }
        let event = found?.clone();
        cursor.next = event.sequence + 1;
        Some(event)
    }
}

/// One of the readers that the server allows.
#[derive(Debug)]
pub(crate) struct Seat(Arc<AtomicUsize>);

impl Seat {
    /// A seat, if fewer than `most` are taken.
    pub(crate) fn take(taken: &Arc<AtomicUsize>, most: usize) -> Option<Seat> {
        let seat = Seat(taken.clone());
        (taken.fetch_add(1, Ordering::Relaxed) < most).then_some(seat)
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The events as a stream that ends with the session. What the reader does not take waits in the ring, not in the writer.
/// It also ends when `time_left` has passed, the deadline of the call.
pub(crate) fn follow(
    feed: Arc<Feed>,
    start: Start,
    without_stages: bool,
    seat: Seat,
    time_left: Option<Duration>,
) -> Watch<v1::WatchSessionResponse> {
    let (sender, receiver) = mpsc::channel(IN_FLIGHT);
    let mut last = feed.last.subscribe();
    let mut cursor = feed.cursor(start, without_stages);
    let end = time_left.and_then(|left| tokio::time::Instant::now().checked_add(left));
    tokio::spawn(async move {
        let _seat = seat;
        let told = sender.clone();
        let read = async move {
            loop {
                last.borrow_and_update();
                while let Some(event) = feed.next(&mut cursor) {
                    let is_last = matches!(event.event, Some(Event::SessionClosed(_)));
                    if sender.send(Ok(event)).await.is_err() || is_last {
                        return;
                    }
                }
                tokio::time::sleep(PACE).await;
                tokio::select! {
                    changed = last.changed() => if changed.is_err() { return },
                    () = sender.closed() => return,
                }
            }
        };
        match end {
            None => read.await,
            Some(end) => {
                if tokio::time::timeout_at(end, read).await.is_err() {
                    // A reader that reads nothing any more is not waited for.
                    let _ = told.try_send(Err(status_of(&too_late().into())));
                }
            }
        }
    });
    Watch::of_progress(receiver, CancelToken::new())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn revision(n: u64) -> Event {
        Event::RevisionMade(v1::RevisionMade { base_revision: n - 1, ..Default::default() })
    }

    fn stage() -> Event {
        Event::StageMoved(v1::StageMoved::default())
    }

    fn read(feed: &Feed, start: Start, without_stages: bool) -> Vec<(u64, &'static str)> {
        let mut cursor = feed.cursor(start, without_stages);
        let name = |event: v1::WatchSessionResponse| match event.event.expect("event") {
            Event::RevisionMade(_) => "revision",
            Event::StageMoved(_) => "stage",
            Event::WorkEnded(_) => "end",
            Event::Lagged(_) => "lagged",
            Event::SessionClosed(_) => "closed",
        };
        std::iter::from_fn(|| feed.next(&mut cursor).map(|e| (e.sequence, name(e)))).collect()
    }

    #[test]
    fn readers_begin_where_they_ask_for() {
        let feed = Feed::new(Clock::default());
        for n in 1..=3 {
            feed.push(n, revision(n));
            feed.push(n, stage());
        }
        assert_eq!(read(&feed, Start::Now, false), []);
        assert_eq!(read(&feed, Start::AfterSequence(4), false), [(5, "revision"), (6, "stage")]);
        assert_eq!(read(&feed, Start::AfterRevision(2), true), [(5, "revision")]);
        assert_eq!(read(&feed, Start::AfterSequence(0), true), [(1, "revision"), (3, "revision"), (5, "revision")]);
        assert_eq!(read(&feed, Start::AfterSequence(99), false), [(6, "lagged")], "of another run of the daemon");
        assert_eq!(read(&feed, Start::AfterRevision(77), false), [(6, "lagged")]);
        feed.close(3, v1::SessionEnd::Deleted);
        feed.push(4, revision(4));
        assert_eq!(read(&feed, Start::Now, false), [(7, "closed")], "who comes late is told, and nothing comes after");
    }

    #[test]
    fn what_is_dropped_is_told_and_stages_drop_no_revision() {
        let feed = Feed::new(Clock::default());
        feed.push(1, revision(1));
        (0..3000).for_each(|_| feed.push(1, stage()));
        let all = read(&feed, Start::AfterSequence(0), false);
        assert_eq!(&all[..3], [(1, "revision"), (1977, "lagged"), (1978, "stage")]);
        assert_eq!(all.len(), 2 + KEPT_STAGE_EVENTS);
        assert_eq!(read(&feed, Start::AfterSequence(0), true), [(1, "revision")], "nothing missed of what it asked for");
        (2..1000).for_each(|n| feed.push(n, revision(n)));
        let late = read(&feed, Start::AfterRevision(1), true);
        assert_eq!(late[0].1, "lagged");
        assert_eq!(late.len(), 1 + KEPT_OTHER_EVENTS);
    }

    #[test]
    fn seats_are_given_back() {
        let taken = Arc::default();
        let first = Seat::take(&taken, 1);
        assert!(first.is_some() && Seat::take(&taken, 1).is_none());
        drop(first);
        assert!(Seat::take(&taken, 1).is_some());
    }
}
