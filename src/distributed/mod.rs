//! One image, rendered together by several processes under MPI: `mpirun -n N prpf render SCENE`.
//!
//! Every process reads the scene. The first one runs the render loop and decides everything; the others serve it. Each
//! process owns a rectangle of pixels: it alone takes their samples and keeps their statistics. As a sample depends on seed,
//! pixel, index and dimension alone, the statistics are those of one process, whoever owns a pixel.
//!
//! | file | holds |
//! | --- | --- |
//! | `partition` | divides the image into rectangles of equal cost |
//! | `link` | sends and receives bytes |
//! | `exchange` | moves statistics from the rectangles that processes have to those that they want |
//! | `command` | the commands of the first process, and what the others answer |
//! | `coordinator` | the render loop's [`crate::progressive::ProcessGroup`], in the first process |
//! | `shared_image` | what filters of parts ask of the whole image, and their results as one |
//! | `worker` | what the other processes do |
//! | `watch` | notices that a process on this machine was killed |
//! | `processes` | [`Processes`]: start, agreement on the inputs, end |

#[cfg(feature = "mpi")]
mod command;
#[cfg(feature = "mpi")]
mod coordinator;
#[cfg(feature = "mpi")]
mod exchange;
#[cfg(feature = "mpi")]
mod link;
mod partition;
#[cfg(feature = "mpi")]
mod processes;
#[cfg(feature = "mpi")]
mod shared_image;
mod watch;
#[cfg(feature = "mpi")]
mod worker;

#[cfg(feature = "mpi")]
pub use processes::Processes;
