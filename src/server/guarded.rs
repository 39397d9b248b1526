//! Connections under limits: how many there are, and how long a new one may say nothing.

use crate::state::Shared;
use crate::status::Fault;
use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep, sleep_until};
use tokio_stream::{Stream, StreamExt};
use tonic::transport::server::Connected;
use tonic::{Code, Streaming};

/// The next message of a client, if it comes in time: a stream that stands still holds memory and a place.
///
/// # Errors
/// [`Fault::UploadBroken`]: nothing came for `idle`, or what the transport says.
pub(crate) async fn next_message<M>(stream: &mut Streaming<M>, idle: Duration) -> Result<Option<M>, Fault> {
    match tokio::time::timeout(idle, stream.message()).await {
        Ok(next) => next.map_err(|status| Fault::UploadBroken { code: status.code(), cause: status.message().to_owned() }),
        Err(_) => Err(Fault::UploadBroken { code: Code::DeadlineExceeded, cause: format!("nothing came for {} s", idle.as_secs_f64()) }),
    }
}

/// What a client of HTTP/2 says first: 24 bytes and a frame of settings.
const FIRST_WORDS: usize = 24 + 9;

/// A connection that holds a place and must speak in time. After its first words the keep-alive of HTTP/2 looks after it.
pub(crate) struct Guarded<S> {
    inner: S,
    heard: usize,
    patience: Option<Pin<Box<Sleep>>>,
    _place: OwnedSemaphorePermit,
}

/// Takes connections while there are places, and closes the others as they come.
pub(crate) fn guarded<S: Connected + Unpin>(
    shared: &Arc<Shared>,
    connections: impl Stream<Item = io::Result<S>>,
) -> impl Stream<Item = io::Result<Guarded<S>>> {
    let most = shared.config.max_connections.clamp(1, Semaphore::MAX_PERMITS);
    let (places, patience) = (Arc::new(Semaphore::new(most)), shared.config.first_word);
    connections.filter_map(move |connection| {
        let inner = match connection {
            Ok(inner) => inner,
            Err(error) => return Some(Err(error)),
        };
        let Ok(place) = places.clone().try_acquire_owned() else {
            tracing::warn!(target: "audit", action = "refuse", most, "a connection too many");
            return None;
        };
        let patience = Instant::now().checked_add(patience).map(|at| Box::pin(sleep_until(at)));
        Some(Ok(Guarded { inner, heard: 0, patience, _place: place }))
    })
}

impl<S: Connected> Connected for Guarded<S> {
    type ConnectInfo = S::ConnectInfo;

    fn connect_info(&self) -> Self::ConnectInfo {
        self.inner.connect_info()
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Guarded<S> {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context<'_>, buffer: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let read = Pin::new(&mut self.inner).poll_read(context, buffer);
        if self.patience.is_none() {
            return read;
        }
        self.heard += buffer.filled().len() - before;
        if self.heard >= FIRST_WORDS {
            self.patience = None;
            return read;
        }
        match self.patience.as_mut().map(|patience| patience.as_mut().poll(context)) {
            Some(Poll::Ready(())) => Poll::Ready(Err(io::Error::new(io::ErrorKind::TimedOut, "the client says nothing"))),
            _ => read,
        }
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Guarded<S> {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.inner).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_shutdown(context)
    }

    fn poll_write_vectored(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[io::IoSlice<'_>]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.inner).poll_write_vectored(context, bytes)
    }

    fn is_write_vectored(&self) -> bool {
        self.inner.is_write_vectored()
    }
}
