/// What kind of failure an error is, for programs that act on it without knowing every error there is. Each error type
/// of this library tells its own by a method `class`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorClass {
    /// What was given cannot be used: a file, a scene, a setting, a graph.
    Input,
    /// No device is there that can do what is asked.
    Device,
    /// The device stopped answering; another try may succeed.
    Lost,
    /// This machine or its device has too little memory; trying again will not help.
    Memory,
    /// The caller stopped it.
    Interrupted,
    /// Anything else: the driver, the file system, a library that is missing.
    Other,
}
