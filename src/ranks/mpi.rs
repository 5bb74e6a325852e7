//! Ranks that are processes of an MPI job.

use mpi::environment::Universe;
use mpi::topology::{Communicator as _, SimpleCommunicator};
use mpi::traits::{Destination as _, Source as _};

use crate::error::{Error, Result};
use crate::num;
use crate::ranks::communicator::Communicator;

/// The processes of an MPI job. MPI ends with this value, and a process has one. Only the thread that made it may use it.
pub struct Mpi {
    world: SimpleCommunicator,
    // Last: finalises.
    _universe: Universe,
}

impl std::fmt::Debug for Mpi {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "rank {} of {}", self.rank(), self.size())
    }
}

impl Mpi {
    /// Joins the job that the process was started in, or makes one of this process alone.
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] where MPI was initialised before.
    pub fn join() -> Result<Self> {
        let universe = mpi::initialize().ok_or_else(|| {
            Error::unsupported("ranks", "MPI that is not yet in use: this process has initialised it before")
        })?;
        Ok(Self { world: universe.world(), _universe: universe })
    }

    /// Returns the number of this process among those of the job on its machine.
    #[must_use]
    pub fn local_rank(&self) -> u32 {
        let local = self.world.split_shared(0);
        u32::try_from(local.rank()).unwrap_or(0)
    }
}

impl Communicator for Mpi {
    fn rank(&self) -> u32 {
        // MPI counts ranks from 0 in a C int.
        u32::try_from(self.world.rank()).unwrap_or(0)
    }

    fn size(&self) -> u32 {
        u32::try_from(self.world.size()).unwrap_or(1)
    }

    fn exchange(&self, messages: &[(u32, Vec<u8>)]) -> Result<Vec<Vec<u8>>> {
        let process = |rank: u32| self.world.process_at_rank(i32::try_from(rank).unwrap_or(0));
        for (rank, bytes) in messages {
            if i32::try_from(bytes.len()).is_err() {
                let why =
                    format!("{} bytes for rank {rank}: a message has at most 2 GiB", num::wide(bytes.len()));
                return Err(Error::invalid("image of ranks", why));
            }
        }
        let received = mpi::request::scope(|scope| {
            let sends: Vec<_> = messages
                .iter()
                .map(|(rank, bytes)| process(*rank).immediate_send(scope, &bytes[..]))
                .collect();
            let received = messages.iter().map(|(rank, _)| process(*rank).receive_vec::<u8>().0).collect();
            for send in sends {
                send.wait();
            }
            received
        });
        Ok(received)
    }
}
