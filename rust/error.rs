//! One enum, a variant for each broken rule, each with array, index and value.

use std::fmt;

/// Why a call could not be answered.
#[derive(Debug, Clone, PartialEq)]
pub enum Error {
    /// The mesh breaks a rule of a legal mesh; the text names rule, array, index and value.
    Mesh(String),
    /// An argument is out of its range; the text names it, its value and its range.
    Argument(String),
    /// The caller asked to stop.
    Stopped,
    /// A promise of this package did not hold: a defect of ours, never the user's.
    Internal(String),
}

impl fmt::Display for Error {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Mesh(text) | Error::Argument(text) => out.write_str(text),
            Error::Stopped => out.write_str("stopped"),
            Error::Internal(text) => write!(out, "internal error, please report it: {text}"),
        }
    }
}

impl std::error::Error for Error {}
