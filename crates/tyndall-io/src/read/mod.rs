//! The readers, one file a format, behind one recognition by content.
