//! Long work that outlives the call that started it.

use crate::connection::Client;
use crate::error::{ClientError, Result};
use crate::retry::{new_request_id, send};
use remesh_proto::v1;
use std::time::Duration;
use v1::start_operation_request::Work;

fn whole(operation: Option<v1::Operation>) -> Result<v1::Operation> {
    operation.ok_or_else(|| ClientError::protocol("an answer without the operation"))
}

/// How long one call waits; longer waits are several calls.
const SLICE: Duration = Duration::from_secs(60);

impl Client {
    /// Starts work on a session, which goes on whatever becomes of this client.
    ///
    /// # Errors
    /// `SESSION_NOT_FOUND`; `QUEUE_FULL`, `LIMIT_REACHED` if too much is on already.
    pub async fn start(&self, session: &str, work: Work) -> Result<v1::Operation> {
        let request = v1::StartOperationRequest {
            session: session.to_owned(),
            expected_revision: None,
            work: Some(work),
            request_id: new_request_id(),
        };
        whole(send!(self.operations.start_operation(request)).operation)
    }

    /// How an operation stands.
    ///
    /// # Errors
    /// `OPERATION_NOT_FOUND`, `SESSION_NOT_FOUND`.
    pub async fn operation(&self, name: &str) -> Result<v1::Operation> {
        whole(send!(self.operations.get_operation(v1::GetOperationRequest { name: name.to_owned() })).operation)
    }

    /// The operations of a session, oldest first, without their results.
    ///
    /// # Errors
    /// `SESSION_NOT_FOUND`.
    pub async fn list_operations(&self, session: &str) -> Result<Vec<v1::Operation>> {
        Ok(send!(self.operations.list_operations(v1::ListOperationsRequest { session: session.to_owned() })).operations)
    }

    /// Waits until an operation has ended, over broken connections.
    ///
    /// # Errors
    /// Those of [`Client::operation`]. Work that failed is no error here: see its `outcome`.
    pub async fn wait(&self, name: &str) -> Result<v1::Operation> {
        let timeout = prost_types::Duration::try_from(SLICE).ok();
        loop {
            let request = v1::WaitOperationRequest { name: name.to_owned(), timeout };
            let operation = whole(send!(self.operations.wait_operation(request)).operation)?;
            if operation.state() != v1::OperationState::Running {
                return Ok(operation);
            }
        }
    }

    /// Stops an operation; it ends at its next checkpoint.
    ///
    /// # Errors
    /// Those of [`Client::operation`].
    pub async fn cancel(&self, name: &str) -> Result<v1::Operation> {
        whole(send!(self.operations.cancel_operation(v1::CancelOperationRequest { name: name.to_owned() })).operation)
    }
}
