//! MP4 by the program `ffmpeg`, which is told the pictures as they are made.

use std::ffi::OsString;
use std::fs;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use super::{Frames, mp4};

/// Whether `ffmpeg` is on the PATH and encodes by libx264.
pub(super) fn has_x264() -> bool {
    let told = Command::new("ffmpeg").args(["-hide_banner", "-v", "error", "-encoders"]).output();
    told.is_ok_and(|told| String::from_utf8_lossy(&told.stdout).contains(" libx264 "))
}

/// The running program.
pub(super) struct Process {
    child: Child,
    path: PathBuf,
}

impl Process {
    pub(super) fn start(path: &Path, [width, height]: [u32; 2], rate: f64) -> io::Result<Self> {
        let size = format!("{width}x{height}");
        let rate = rate.to_string();
        // A name that looks like an option or a protocol is a file's all the same.
        let mut file = OsString::from("file:");
        file.push(path);
        let mut command = Command::new("ffmpeg");
        command.args(["-hide_banner", "-v", "error", "-y"]);
        command.args([
            "-f",
            "rawvideo",
            "-pix_fmt",
            "rgb24",
            "-video_size",
            &size,
            "-framerate",
            &rate,
            "-i",
            "-",
        ]);
        command.args(["-vf", "scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd+full_chroma_int"]);
        command.args(["-c:v", "libx264", "-preset", "medium", "-crf", "18", "-pix_fmt", "yuv420p"]);
        command.args(["-color_range", "tv", "-colorspace", "bt709", "-color_primaries", "bt709"]);
        command.args(["-color_trc", "iec61966-2-1", "-movflags", "+faststart", "-f", "mp4"]).arg(file);
        let child = command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn()?;
        Ok(Self { child, path: path.into() })
    }

    /// Waits for the end; what the program complains of is the error.
    fn wait(&mut self) -> io::Result<()> {
        drop(self.child.stdin.take());
        let mut complaint = String::new();
        if let Some(mut stderr) = self.child.stderr.take() {
            stderr.read_to_string(&mut complaint)?;
        }
        let status = self.child.wait()?;
        if status.success() {
            return Ok(());
        }
        let complaint = complaint.trim();
        let text = if complaint.is_empty() { status.to_string() } else { complaint.to_string() };
        Err(io::Error::other(format!("ffmpeg failed: {text}")))
    }
}

impl Frames for Process {
    fn add(&mut self, pixels: &[u8]) -> io::Result<()> {
        let Some(stdin) = &mut self.child.stdin else { return self.wait() };
        match stdin.write_all(pixels) {
            // It ended before its time: why, it says.
            Err(error) => self.wait().and(Err(error)),
            written => written,
        }
    }

    fn finish(mut self: Box<Self>, metadata: &[(String, String)]) -> io::Result<()> {
        self.wait()?;
        mp4::append_metadata(&mut fs::File::options().append(true).open(&self.path)?, metadata)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // One that has ended cannot be killed, and need not be.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
