//! Calls and the compute pool: who may compute when, how a call is stopped, and what the log says of its end.

use crate::answers::{Once, Open};
use crate::caller::Caller;
use crate::desk::{Desk, Target, short_id};
use crate::operations::Operation;
use crate::progress::Meter;
use crate::state::Shared;
use crate::status::{Fault, Told, code_name, log_end, status_of};
use crate::stream::{Chunks, Watch};
use crate::trace_context::{self, StageSpans};
use remesh_engine::EngineError;
use remesh_engine::error::{Reason, Result as EngineResult};
use remesh_engine::pipeline::Run;
use remesh_engine::stage::{Outcome, StageRecord, Subject};
use remesh_engine::work::CancelToken;
use remesh_proto::v1;
use std::collections::HashMap;
use std::hash::{BuildHasher, RandomState};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use tokio::sync::{Semaphore, mpsc};
use tonic::metadata::MetadataMap;
use tonic::{Request, Response, Status};
use tracing::{Instrument, Span};
use v1::watch_session_response::Event;

/// How long a computation is likely to take; long ones must not keep short ones waiting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Intent {
    /// Reads, plans, diagnoses, one patch: somebody waits before a screen. Long work pauses meanwhile.
    Short,
    /// Anything that may run most of the pipeline.
    Long,
}

impl Intent {
    /// Threads that it may take. Short work starts none: what it looks up is found sooner than a thread is started and waited for.
    fn threads(self, shared: &Shared) -> usize {
        match self {
            Intent::Short => 1,
            Intent::Long => shared.config.engine.threads,
        }
    }

    /// Of work that has to run what a plan says is not cached: short if that is nothing of the whole surface, but little of a few patches.
    pub(crate) fn of_plan<'a>(records: impl IntoIterator<Item = &'a StageRecord>) -> Intent {
        let mut estimated = 0.0;
        for record in records.into_iter().filter(|record| record.outcome == Outcome::Run) {
            if record.subject == Subject::Surface {
                return Intent::Long;
            }
            estimated += record.milliseconds;
        }
        if estimated <= SHORT_MILLISECONDS { Intent::Short } else { Intent::Long }
    }
}

/// Work on patches that is estimated to take longer is long.
const SHORT_MILLISECONDS: f64 = 1000.0;

/// What is known beforehand of how long a computation takes.
pub(crate) enum Weight {
    /// Enough.
    Known(Intent),
    /// As much as a plan tells. If there is no plan, there will be no computation but an error.
    Planned(Plan),
}

/// Makes a plan, which computes nothing.
type Plan = Box<dyn FnOnce(&Shared, &Run<'_>) -> EngineResult<Intent> + Send>;

impl Weight {
    /// Of a computation that is planned first.
    pub(crate) fn planned(plan: impl FnOnce(&Shared, &Run<'_>) -> EngineResult<Intent> + Send + 'static) -> Weight {
        Weight::Planned(Box::new(plan))
    }
}

impl From<Intent> for Weight {
    fn from(intent: Intent) -> Weight {
        Weight::Known(intent)
    }
}

/// What became of work that was planned: short work is done where its plan was made, since each way between threads takes time.
enum Planned<T, W> {
    Done(T),
    Long(W),
}

/// Permits to compute, and the calls that are on.
#[derive(Debug)]
pub(crate) struct Pool {
    short: Arc<Semaphore>,
    long: Arc<Semaphore>,
    max_queued: usize,
    queued: AtomicUsize,
    running: Arc<AtomicUsize>,
    draining: AtomicBool,
    next_call: AtomicU64,
    calls: Mutex<HashMap<u64, CancelToken>>,
}

/// A place in the queue, given back when dropped.
struct Place<'a>(&'a Pool);

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.0.queued.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Counts a running computation.
struct Running(Arc<AtomicUsize>);

impl Drop for Running {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Pool {
    /// A pool with so many permits.
    pub(crate) fn new(long: usize, short: usize, max_queued: usize) -> Self {
        Pool {
            short: Arc::new(Semaphore::new(short.clamp(1, Semaphore::MAX_PERMITS))),
            long: Arc::new(Semaphore::new(long.clamp(1, Semaphore::MAX_PERMITS))),
            max_queued,
            queued: AtomicUsize::new(0),
            running: Arc::default(),
            draining: AtomicBool::new(false),
            next_call: AtomicU64::new(0),
            calls: Mutex::default(),
        }
    }

    fn calls(&self) -> MutexGuard<'_, HashMap<u64, CancelToken>> {
        self.calls.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// Calls that wait for a permit.
    pub(crate) fn queued(&self) -> usize {
        self.queued.load(Ordering::Relaxed)
    }

    /// Computations that run.
    pub(crate) fn running(&self) -> usize {
        self.running.load(Ordering::Relaxed)
    }

    /// Whether new calls are refused.
    pub(crate) fn is_draining(&self) -> bool {
        self.draining.load(Ordering::Relaxed)
    }

    /// Refuses new calls from now on.
    pub(crate) fn drain(&self) {
        self.draining.store(true, Ordering::Relaxed);
    }

    /// Cancels all calls and gives how many there were.
    pub(crate) fn cancel_all(&self) -> usize {
        let calls = self.calls();
        calls.values().for_each(CancelToken::cancel);
        calls.len()
    }

    /// Whether a call more would be refused if there were no permit.
    pub(crate) fn is_full(&self) -> bool {
        self.long.available_permits() == 0 && self.queued() >= self.max_queued
    }

    fn place(&self) -> Result<Place<'_>, Fault> {
        let before = self.queued.fetch_add(1, Ordering::Relaxed);
        let place = Place(self);
        if before >= self.max_queued { Err(Fault::QueueFull { queued: before }) } else { Ok(place) }
    }

    async fn permit(&self, intent: Intent) -> Result<tokio::sync::OwnedSemaphorePermit, Fault> {
        let semaphore = match intent {
            Intent::Short => &self.short,
            Intent::Long => &self.long,
        };
        if let Ok(permit) = semaphore.clone().try_acquire_owned() {
            return Ok(permit);
        }
        let _place = self.place()?;
        semaphore.clone().acquire_owned().await.map_err(|_| Fault::Draining)
    }
}

/// One call. Dropping it before its end cancels its work.
pub(crate) struct Call {
    shared: Arc<Shared>,
    id: u64,
    token: CancelToken,
    deadline: Option<Instant>,
    span: Span,
    begin: Instant,
    ended: bool,
    method: &'static str,
    caller: Caller,
    /// Whose limits the call counts for: the name of the caller, or its address.
    client: Arc<str>,
    /// What belongs to the session of the call, and the revision that the call is for.
    desk: Option<(Arc<Desk>, u64)>,
}

impl Drop for Call {
    fn drop(&mut self) {
        self.token.cancel();
        self.shared.pool.calls().remove(&self.id);
        if let Some((desk, _)) = &self.desk {
            desk.works.remove(self.id);
        }
        if !self.ended {
            let _entered = self.span.enter();
            tracing::debug!(milliseconds = self.milliseconds(), "the client went away");
            trace_context::ended(&self.span, "Cancelled");
            self.shared.metrics.call(self.method, "Cancelled", self.milliseconds());
        }
    }
}

impl Call {
    /// Begins a call: refuses it if the server shuts down, reads its deadline, opens its span.
    pub(crate) fn begin<R>(shared: &Arc<Shared>, method: &'static str, request: &Request<R>) -> Result<Call, Status> {
        let id = shared.pool.next_call.fetch_add(1, Ordering::Relaxed);
        let begin = Instant::now();
        let deadline = timeout_of(request.metadata()).and_then(|timeout| begin.checked_add(timeout));
        let token = deadline.into_iter().fold(CancelToken::new(), CancelToken::with_deadline);
        shared.pool.calls().insert(id, token.clone());
        let caller = request.extensions().get::<Caller>().cloned().unwrap_or_default();
        let empty = tracing::field::Empty;
        let span = tracing::info_span!("call", method, id, peer = empty, caller = empty, session = empty, revision = empty);
        trace_context::adopt(&span, request.metadata());
        if let Some(peer) = request.remote_addr() {
            span.record("peer", tracing::field::display(peer));
        }
        if !caller.name().is_empty() {
            span.record("caller", caller.name());
        }
        let client = match (caller.name(), request.remote_addr()) {
            ("", Some(peer)) => peer.ip().to_string().into(),
            ("", None) => "".into(),
            (name, _) => name.into(),
        };
        let shared = shared.clone();
        let mut call = Call { shared, id, token, deadline, span, begin, ended: false, method, caller, client, desk: None };
        // Looked at after the call is in the table, so that it is either refused here or seen by `cancel_all`.
        if call.shared.pool.is_draining() {
            return Err(call.end(&Fault::Draining));
        }
        Ok(call)
    }

    fn milliseconds(&self) -> f64 {
        self.begin.elapsed().as_secs_f64() * 1e3
    }

    fn end(&mut self, fault: &Fault) -> Status {
        self.ended = true;
        let (_entered, code) = (self.span.enter(), code_name(fault));
        log_end(Some(fault), self.milliseconds());
        trace_context::ended(&self.span, code);
        self.shared.metrics.call(self.method, code, self.milliseconds());
        status_of(fault)
    }

    /// Ends the call.
    pub(crate) fn finish<T>(mut self, result: Result<T, Fault>) -> Result<Response<T>, Status> {
        match result {
            Ok(value) => {
                self.ended = true;
                let _entered = self.span.enter();
                log_end(None, self.milliseconds());
                trace_context::ended(&self.span, "OK");
                self.shared.metrics.call(self.method, "OK", self.milliseconds());
                drop(_entered);
                Ok(Response::new(value))
            }
            Err(fault) => Err(self.end(&fault)),
        }
    }

    /// The value, or the end of the call.
    pub(crate) fn check<T>(&mut self, result: EngineResult<T>) -> Result<T, Status> {
        result.map_err(|error| self.end(&error.into()))
    }

    /// Whose limits the call counts for.
    pub(crate) fn client(&self) -> &Arc<str> {
        &self.client
    }

    /// Time to the deadline, if there is one.
    pub(crate) fn time_left(&self) -> Option<Duration> {
        self.deadline.map(|at| at.saturating_duration_since(Instant::now()))
    }

    /// Starts work that goes on after the call, without its deadline.
    pub(crate) fn start(
        &self,
        target: &Target,
        work: impl FnOnce(&Shared, &Run<'_>, &Target) -> EngineResult<v1::operation::Outcome> + Send + 'static,
    ) -> Result<Arc<Operation>, Fault> {
        if self.shared.pool.is_full() {
            return Err(Fault::QueueFull { queued: self.shared.pool.queued() });
        }
        let id = self.shared.pool.next_call.fetch_add(1, Ordering::Relaxed);
        let token = CancelToken::new();
        self.shared.pool.calls().insert(id, token.clone());
        let call = Call {
            shared: self.shared.clone(),
            id,
            token: token.clone(),
            deadline: None,
            span: tracing::info_span!(parent: &self.span, "operation", id),
            begin: Instant::now(),
            ended: false,
            method: "Operation",
            caller: self.caller.clone(),
            client: self.client.clone(),
            desk: Some((target.desk.clone(), target.revision())),
        };
        target.desk.works.add(id, &token)?;
        let operation = target.desk.operations.begin(target.revision(), token, self.shared.config.clock.clone())?;
        let (started, target) = (operation.clone(), target.clone());
        tokio::spawn(async move {
            let moving = operation.clone();
            let meter = Meter::new(move |progress| moving.progress(progress));
            let result = call.work(Intent::Long.into(), Some(meter), move |shared, run| work(shared, run, &target)).await;
            let told = result.as_ref().err().cloned();
            operation.end(result);
            // For the log and the metrics only.
            drop(call.finish(told.map_or(Ok(()), Err)));
        });
        Ok(started)
    }

    /// Who calls.
    pub(crate) fn caller(&self) -> &Caller {
        &self.caller
    }

    /// The session that the call names, or the end of the call.
    pub(crate) fn target(&mut self, session: &str, expected_revision: Option<u64>) -> Result<Target, Status> {
        self.target_of_edit(session, expected_revision, &Open::default())
    }

    /// The session that an edit names, or the end of the call.
    pub(crate) fn target_of_edit(&mut self, session: &str, base_revision: Option<u64>, open: &Open) -> Result<Target, Status> {
        let target = self.shared.target(session, base_revision, &self.caller, open.id());
        let target = self.check(target)?;
        self.span.record("session", short_id(&target.session)).record("revision", target.revision());
        let added = target.desk.works.add(self.id, &self.token);
        self.desk = Some((target.desk.clone(), target.revision()));
        self.check(added)?;
        Ok(target)
    }

    /// What is known of an edit that may come more than once, or the end of the call. Looked at before the revision is: the edit may have
    /// made the next one.
    pub(crate) async fn once<A: prost::Message + Default>(
        &mut self,
        session: &str,
        request_id: &str,
        request: &impl prost::Message,
    ) -> Result<Once<A>, Status> {
        let found = self.shared.session(session, "session", &self.caller);
        let (_, desk) = self.check(found)?;
        let known = desk.answers.once(request_id, self.method, request);
        let known = match self.deadline {
            None => known.await,
            Some(deadline) => tokio::time::timeout_at(deadline.into(), known).await.unwrap_or_else(|_| Err(too_late())),
        };
        self.check(known)
    }

    /// Answers with the outcome of a computation on the pool.
    pub(crate) async fn compute<T: Send + 'static>(
        self,
        weight: impl Into<Weight>,
        work: impl FnOnce(&Shared, &Run<'_>) -> EngineResult<T> + Send + 'static,
    ) -> Result<Response<T>, Status> {
        let result = self.work(weight.into(), None, work).await;
        self.finish(result)
    }

    /// Answers with the outcome of work that is short but may wait for the disk; without a data folder it waits for nothing.
    pub(crate) async fn on_disk<T: Send + 'static, E: Into<Fault> + Send + 'static>(
        self,
        work: impl FnOnce(&Shared) -> Result<T, E> + Send + 'static,
    ) -> Result<Response<T>, Status> {
        if !self.shared.keeper.is_on() {
            let result = work(&self.shared);
            return self.finish(result.map_err(Into::into));
        }
        let (shared, span) = (self.shared.clone(), self.span.clone());
        let done = tokio::task::spawn_blocking(move || span.in_scope(|| catch_unwind(AssertUnwindSafe(|| work(&shared))))).await;
        let result = match done {
            Ok(Ok(result)) => result.map_err(Into::into),
            Ok(Err(panic)) => Err(panicked(panic.as_ref())),
            Err(_) => Err(Fault::Draining),
        };
        self.finish(result)
    }

    /// The outcome of a computation on the pool, for a call that goes on after it.
    pub(crate) async fn on_pool<T: Send + 'static>(
        self,
        weight: impl Into<Weight>,
        work: impl FnOnce(&Shared, &Run<'_>) -> EngineResult<T> + Send + 'static,
    ) -> (Self, Result<T, Fault>) {
        let result = self.work(weight.into(), None, work).await;
        (self, result)
    }

    /// Answers with a computed stream of messages, made one by one as the client takes them.
    pub(crate) async fn bulk<M: Send + 'static>(
        self,
        weight: impl Into<Weight>,
        work: impl FnOnce(&Shared, &Run<'_>) -> EngineResult<Chunks<M>> + Send + 'static,
    ) -> Result<Response<Watch<M>>, Status> {
        let result = self.work(weight.into(), None, work).await;
        let deadline = self.deadline;
        self.finish(result.map(|chunks| Watch::of_chunks(chunks, deadline)))
    }

    /// Answers at once with a stream of progress that ends with the outcome of a computation on the pool.
    pub(crate) fn watch<M: Send + 'static, T: Send + 'static>(
        self,
        weight: impl Into<Weight>,
        wrap_progress: impl Fn(v1::Progress) -> M + Send + 'static,
        wrap_result: impl FnOnce(T) -> M + Send + 'static,
        work: impl FnOnce(&Shared, &Run<'_>) -> EngineResult<T> + Send + 'static,
    ) -> Result<Response<Watch<M>>, Status> {
        let (sender, receiver) = mpsc::channel(PROGRESS_BUFFER);
        let weight = weight.into();
        let token = self.token.clone();
        let meter_sender = sender.clone();
        let task = async move {
            let meter = Meter::new(move |progress| {
                // A client that reads slowly misses progress, never the result.
                let _ = meter_sender.try_send(Ok(wrap_progress(progress)));
            });
            let result = self.work(weight, Some(meter), work).await;
            let last = self.finish(result).map(|response| wrap_result(response.into_inner()));
            let _ = sender.send(last).await;
        };
        tokio::spawn(task);
        Ok(Response::new(Watch::of_progress(receiver, token)))
    }

    /// [`Call::run`] that tells the end of the work to those who watch the session, if there was any: an answer that needed no stage is
    /// no news.
    async fn work<T: Send + 'static>(
        &self,
        weight: Weight,
        meter: Option<Meter>,
        work: impl FnOnce(&Shared, &Run<'_>) -> EngineResult<T> + Send + 'static,
    ) -> Result<T, Fault> {
        let begin = Instant::now();
        let moved = Arc::new(AtomicBool::new(false));
        let stages = self.desk.clone().map(|(desk, revision)| {
            let (call, moved) = (self.id, moved.clone());
            Meter::new(move |progress| {
                moved.store(true, Ordering::Relaxed);
                desk.feed.push(revision, Event::StageMoved(v1::StageMoved { call, progress: Some(progress) }));
            })
        });
        let meters = Arc::new([meter, stages]);
        let result = match weight {
            Weight::Known(intent) => self.run(intent, meters, work).await,
            Weight::Planned(plan) => {
                let both = |shared: &Shared, run: &Run<'_>| match plan(shared, run) {
                    Ok(Intent::Long) => Ok(Planned::Long(work)),
                    Ok(Intent::Short) | Err(_) => work(shared, run).map(Planned::Done),
                };
                match self.run(Intent::Short, meters.clone(), both).await {
                    Ok(Planned::Done(value)) => Ok(value),
                    Ok(Planned::Long(work)) => self.run(Intent::Long, meters, work).await,
                    Err(fault) => Err(fault),
                }
            }
        };
        if let Some((desk, revision)) = &self.desk
            && (result.is_err() || moved.load(Ordering::Relaxed))
        {
            let Told { code, reason, message } = result.as_ref().err().map(Told::of).unwrap_or_default();
            let milliseconds = begin.elapsed().as_secs_f64() * 1e3;
            let ended = v1::WorkEnded { call: self.id, method: self.method.to_owned(), code, reason, message, milliseconds };
            desk.feed.push(*revision, Event::WorkEnded(ended));
        }
        result
    }

    /// Waits for a permit and runs `work` on a blocking thread, until the deadline. A panic in `work` fails this call only.
    async fn run<T: Send + 'static>(
        &self,
        intent: Intent,
        meters: Arc<[Option<Meter>; 2]>,
        work: impl FnOnce(&Shared, &Run<'_>) -> EngineResult<T> + Send + 'static,
    ) -> Result<T, Fault> {
        let shared = self.shared.clone();
        let (token, gate) = (self.token.clone(), shared.gate.clone());
        let token = match intent {
            Intent::Short => token.urgent(&gate),
            Intent::Long => token.batch(&gate),
        };
        let span = self.span.clone();
        let held = shared.clients.begin(&self.client, shared.config.max_jobs_per_client)?;
        let job = async move {
            let permit = shared.pool.permit(intent).await?;
            shared.pool.running.fetch_add(1, Ordering::Relaxed);
            let running = Running(shared.pool.running.clone());
            let blocking = move || {
                let _entered = span.enter();
                let (_permit, _running, _held) = (permit, running, held);
                let _urgent = (intent == Intent::Short).then(|| gate.enter());
                let spans = StageSpans::of(&span);
                catch_unwind(AssertUnwindSafe(|| {
                    let events = |event: &remesh_engine::pipeline::Event| {
                        shared.metrics.on(event);
                        spans.on(event);
                        meters.iter().flatten().for_each(|meter| meter.on(event));
                    };
                    work(&shared, &Run { cancel: &token, events: &events, threads: intent.threads(&shared) })
                }))
            };
            match tokio::task::spawn_blocking(blocking).await {
                Ok(Ok(result)) => result.map_err(Fault::from),
                Ok(Err(panic)) => Err(panicked(panic.as_ref())),
                Err(_) => Err(Fault::Draining),
            }
        };
        let job = job.instrument(self.span.clone());
        let Some(deadline) = self.deadline else { return job.await };
        tokio::time::timeout_at(deadline.into(), job).await.unwrap_or_else(|_| {
            self.token.cancel();
            Err(too_late().into())
        })
    }
}

/// The deadline of a call has passed.
pub(crate) fn too_late() -> EngineError {
    EngineError::new(Reason::DeadlineExceeded, "the deadline passed before the work was done")
}

/// Progress messages that may wait for the client.
const PROGRESS_BUFFER: usize = 256;

fn panicked(panic: &(dyn std::any::Any + Send)) -> Fault {
    let id = format!("{:016x}", RandomState::new().hash_one(Instant::now()));
    let message = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    tracing::error!(incident = id, message = message.unwrap_or("(no message)"), "a computation panicked");
    Fault::Panicked { id }
}

/// Tonic ends a call at its deadline with a bare CANCELLED. Ours comes this much earlier, with code and reason.
const DEADLINE_MARGIN: Duration = Duration::from_millis(5);

/// The `grpc-timeout` of a call.
fn timeout_of(metadata: &MetadataMap) -> Option<Duration> {
    let text = metadata.get("grpc-timeout")?.to_str().ok()?;
    let (digits, unit) = text.split_at_checked(text.len().checked_sub(1)?)?;
    let value: u64 = digits.parse().ok()?;
    let timeout = match unit {
        "H" => Duration::from_secs(value.checked_mul(3600)?),
        "M" => Duration::from_secs(value.checked_mul(60)?),
        "S" => Duration::from_secs(value),
        "m" => Duration::from_millis(value),
        "u" => Duration::from_micros(value),
        "n" => Duration::from_nanos(value),
        _ => return None,
    };
    Some(timeout.saturating_sub(DEADLINE_MARGIN))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timeouts_are_read_in_all_units() {
        let of = |text: &str| {
            let mut metadata = MetadataMap::new();
            metadata.insert("grpc-timeout", text.parse().expect("ascii"));
            timeout_of(&metadata)
        };
        assert_eq!(of("2S"), Some(Duration::from_millis(1995)));
        assert_eq!(of("1M"), Some(Duration::from_millis(59_995)));
        assert_eq!(of("1000000u"), Some(Duration::from_millis(995)));
        assert_eq!(of("1m"), Some(Duration::ZERO));
        for bad in ["", "S", "12", "-1S", "99999999999999999999S"] {
            assert_eq!(of(bad), None, "{bad}");
        }
    }

    #[tokio::test]
    async fn a_full_queue_refuses_and_places_are_given_back() {
        let pool = Pool::new(1, 1, 0);
        let held = pool.permit(Intent::Long).await.expect("first");
        assert_eq!(pool.permit(Intent::Long).await.map(drop), Err(Fault::QueueFull { queued: 0 }));
        assert!(pool.permit(Intent::Short).await.is_ok(), "short calls do not wait for long ones");
        drop(held);
        assert!(pool.permit(Intent::Long).await.is_ok());
        assert_eq!(pool.queued(), 0);
    }

    #[tokio::test]
    async fn a_panic_fails_one_call_only() {
        let shared = Shared::new(crate::config::ServerConfig::default()).expect("no folder");
        let begin = || Call::begin(&shared, "Test", &Request::new(())).expect("begins");
        let status = begin().compute(Intent::Long, |_, _| -> EngineResult<()> { panic!("boom") }).await.expect_err("panicked");
        assert_eq!(status.code(), tonic::Code::Internal);
        assert!(!status.message().contains("boom"), "details are for the log only");
        assert_eq!(begin().compute(Intent::Long, |_, _| Ok(7)).await.expect("goes on").into_inner(), 7);
        assert_eq!((shared.pool.running(), shared.pool.calls().len()), (0, 0));
    }

    #[tokio::test]
    async fn a_draining_server_refuses() {
        let shared = Shared::new(crate::config::ServerConfig::default()).expect("no folder");
        shared.pool.drain();
        let status = Call::begin(&shared, "Test", &Request::new(())).map(drop).expect_err("refused");
        assert_eq!(status.code(), tonic::Code::Unavailable);
    }
}
