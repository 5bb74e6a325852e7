//! Ranks that are processes of an MPI job.

use mpi::Threading;
use mpi::environment::Universe;
use mpi::topology::{Communicator as _, SimpleCommunicator};
use mpi::traits::{Destination as _, Source as _};

use crate::error::{Error, Result};
use crate::num;
use crate::ranks::communicator::Communicator;

/// Most bytes of a message.
const CHUNK: usize = 1 << 30;

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

impl Drop for Mpi {
    fn drop(&mut self) {
        // Others would wait for this process, and it for them in the end of MPI.
        if std::thread::panicking() {
            self.world.abort(101);
        }
    }
}

impl Mpi {
    /// Joins the job that the process was started in, or makes one of this process alone.
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] where MPI was initialised before.
    pub fn join() -> Result<Self> {
        // Other threads of the process make no calls of MPI.
        let (universe, _) = mpi::initialize_with_threading(Threading::Funneled).ok_or_else(|| {
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
        // MPI counts bytes in a C int: a length goes ahead of chunks.
        let lengths: Vec<[u8; 8]> =
            messages.iter().map(|(_, bytes)| num::wide(bytes.len()).to_le_bytes()).collect();
        let received = mpi::request::scope(|scope| {
            let mut sends = Vec::new();
            for ((rank, bytes), length) in messages.iter().zip(&lengths) {
                sends.push(process(*rank).immediate_send(scope, &length[..]));
                sends.extend(bytes.chunks(CHUNK).map(|chunk| process(*rank).immediate_send(scope, chunk)));
            }
            let receive = |(rank, _): &(u32, Vec<u8>)| {
                let (length, _) = process(*rank).receive_vec::<u8>();
                let length = length.first_chunk::<8>().map_or(0, |length| u64::from_le_bytes(*length));
                let mut bytes = Vec::new();
                while num::wide(bytes.len()) < length {
                    bytes.extend(process(*rank).receive_vec::<u8>().0);
                }
                bytes
            };
            let received = messages.iter().map(receive).collect();
            for send in sends {
                send.wait();
            }
            received
        });
        Ok(received)
    }
}
