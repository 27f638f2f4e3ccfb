//! Messages to the host: a `tracing` layer that hands events to the session's log function.
//!
//! Each session has its own dispatcher, set on the threads that work for it, so that messages of
//! two sessions do not mix. Fields `prim` and `code` of an event become arguments of their own.

use std::cell::Cell;
use std::collections::HashSet;
use std::fmt::{self, Write};
use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use hdtrapeze_core::diagnostics::Warning;
use tracing::field::{Field, Visit};
use tracing::subscriber::Interest;
use tracing::{Dispatch, Event, Level, Metadata, Subscriber};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};
use tracing_subscriber::registry::Registry;

use crate::status::lock;

/// Receives level, prim path, code and text; path and code are empty where there is none.
pub type LogFn = Box<dyn Fn(Level, &str, &str, &str) + Send>;

thread_local! {
    static IN_CALLBACK: Cell<bool> = const { Cell::new(false) };
}

/// True on a thread that is inside a log function right now: there, a call that waits for the
/// session could wait for itself.
pub fn in_log_callback() -> bool {
    IN_CALLBACK.get()
}

/// Where a session's messages go.
pub(crate) struct Log {
    /// Rank of the most verbose level that is wanted; 0 for none.
    wanted: AtomicUsize,
    target: Mutex<Option<LogFn>>,
    /// Warnings that were told.
    told: Mutex<HashSet<(String, &'static str, String)>>,
}

impl Log {
    pub fn new() -> Arc<Self> {
        Arc::new(Self {
            wanted: AtomicUsize::new(0),
            target: Mutex::new(None),
            told: Mutex::new(HashSet::new()),
        })
    }

    /// A dispatcher whose events come here.
    pub fn dispatch(self: &Arc<Self>) -> Dispatch {
        Dispatch::new(Registry::default().with(Forward(self.clone())))
    }

    /// Replaces the log function; waits for a call of the one before.
    pub fn set(&self, target: Option<LogFn>, level: Level) {
        let wanted = if target.is_some() { rank(&level) } else { 0 };
        let mut place = lock(&self.target);
        self.wanted.store(wanted, Ordering::Relaxed);
        let before = std::mem::replace(&mut *place, target);
        drop(place);
        drop(before);
    }

    /// Emits a warning unless the same prim, code and text was told before. The session's
    /// dispatcher must be the current one.
    pub fn warn_once(&self, warning: &Warning) {
        let Warning { prim, code, text } = warning;
        let key = (prim.clone(), code.name(), text.clone());
        if lock(&self.told).insert(key) {
            tracing::warn!(prim = prim.as_str(), code = code.name(), "{text}");
        }
    }

    /// The same for a warning that has no code.
    pub fn say_once(&self, prim: &str, text: &str) {
        if lock(&self.told).insert((prim.to_owned(), "", text.to_owned())) {
            tracing::warn!(prim, "{text}");
        }
    }

    fn send(&self, level: &Level, message: &Message) {
        // An event caused by the log function itself would wait for its own end.
        if IN_CALLBACK.get() {
            return;
        }
        let target = lock(&self.target);
        if let Some(target) = target.as_ref() {
            let _inside = Inside::enter();
            target(*level, &message.prim, &message.code, &message.text);
        }
    }
}

/// Marks the thread as inside a log function, also while that unwinds.
struct Inside;

impl Inside {
    fn enter() -> Self {
        IN_CALLBACK.set(true);
        Inside
    }
}

impl Drop for Inside {
    fn drop(&mut self) {
        IN_CALLBACK.set(false);
    }
}

fn rank(level: &Level) -> usize {
    match *level {
        Level::ERROR => 1,
        Level::WARN => 2,
        Level::INFO => 3,
        Level::DEBUG => 4,
        _ => 5,
    }
}

struct Forward(Arc<Log>);

impl<S: Subscriber> Layer<S> for Forward {
    /// The level may change at any time, so no answer is final.
    fn register_callsite(&self, _: &'static Metadata<'static>) -> Interest {
        Interest::sometimes()
    }

    fn enabled(&self, metadata: &Metadata<'_>, _: Context<'_, S>) -> bool {
        metadata.is_event() && rank(metadata.level()) <= self.0.wanted.load(Ordering::Relaxed)
    }

    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut message = Message::default();
        event.record(&mut message);
        self.0.send(event.metadata().level(), &message);
    }
}

/// Fields of one event; others than prim, code and message are appended to the text.
#[derive(Default)]
struct Message {
    prim: String,
    code: String,
    text: String,
}

impl Message {
    fn put(&mut self, field: &Field, value: &dyn fmt::Display) {
        // Writing to a string does not fail.
        let _ = match field.name() {
            "prim" => write!(self.prim, "{value}"),
            "code" => write!(self.code, "{value}"),
            "message" => {
                let fields = std::mem::take(&mut self.text);
                write!(self.text, "{value}{fields}")
            }
            name => write!(self.text, " {name}={value}"),
        };
    }
}

impl Visit for Message {
    fn record_str(&mut self, field: &Field, value: &str) {
        self.put(field, &value);
    }

    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        self.put(field, &format_args!("{value:?}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hdtrapeze_core::diagnostics::Code;
    use tracing::dispatcher::with_default;

    type Told = Arc<Mutex<Vec<(Level, String, String, String)>>>;

    fn recorder() -> (Told, LogFn) {
        let told = Told::default();
        let sink = told.clone();
        let log: LogFn = Box::new(move |level, prim, code, text| {
            lock(&sink).push((level, prim.into(), code.into(), text.into()));
        });
        (told, log)
    }

    #[test]
    fn a_warning_comes_once_with_its_fields() {
        let (told, sink) = recorder();
        let log = Log::new();
        log.set(Some(sink), Level::WARN);
        with_default(&log.dispatch(), || {
            for prim in ["/a", "/a", "/b"] {
                log.warn_once(&Warning::new(prim, Code::Topology, "is wrong"));
            }
            tracing::info!("not wanted");
            tracing::error!(count = 3, "bad");
        });
        let told = lock(&told);
        let expect = |prim: &str| {
            (
                Level::WARN,
                prim.into(),
                "topology".into(),
                "is wrong".into(),
            )
        };
        let bad = (
            Level::ERROR,
            String::new(),
            String::new(),
            "bad count=3".into(),
        );
        assert_eq!(*told, [expect("/a"), expect("/b"), bad]);
    }

    #[test]
    fn two_sessions_do_not_mix_and_levels_change() {
        let (first, second) = (Log::new(), Log::new());
        let ((told_first, sink_first), (told_second, sink_second)) = (recorder(), recorder());
        first.set(Some(sink_first), Level::INFO);
        second.set(Some(sink_second), Level::ERROR);
        let event = |text: &str| tracing::info!("{text}");
        with_default(&first.dispatch(), || event("to the first"));
        with_default(&second.dispatch(), || event("to nobody"));
        second.set(None, Level::DEBUG);
        with_default(&second.dispatch(), || event("to nobody"));
        let (again, sink_again) = recorder();
        second.set(Some(sink_again), Level::DEBUG);
        with_default(&second.dispatch(), || event("to the second"));
        assert_eq!(lock(&told_first)[0].3, "to the first");
        assert_eq!(lock(&told_first).len(), 1);
        assert!(lock(&told_second).is_empty());
        assert_eq!(lock(&again)[0].3, "to the second");
    }

    #[test]
    fn an_event_from_inside_the_log_function_does_not_hang() {
        let log = Log::new();
        let sink: LogFn = Box::new(|_, _, _, _| {
            assert!(in_log_callback());
            tracing::error!("again");
        });
        log.set(Some(sink), Level::ERROR);
        with_default(&log.dispatch(), || tracing::error!("once"));
        assert!(!in_log_callback());
    }
}
