//! A scanner of lines, words, numbers and binary blocks that tracks its line and byte position.

use std::io::{self, ErrorKind, Read};
use std::str::FromStr;

use crate::error::{Error, Result};
use crate::io::file::decode::NumberBytes;
use crate::io::file::sample_type::SampleType;
use crate::io::file::source::{Encoding, Source};
use crate::io::file::text::{shown, stream_error, to_bytes};
use crate::num;

/// The limit on the length of a line, in bytes.
const MAX_LINE: usize = 1 << 16;

/// The limit on the length of a word, in bytes.
const MAX_WORD: usize = 256;

/// A stream of lines, words and binary blocks that tracks its position.
pub(crate) struct Scanner<'a> {
    source: &'a Source,
    reader: Box<dyn io::BufRead + 'a>,
    /// Lines read.
    line: u64,
    /// Bytes read since the start of the stream.
    position: u64,
    /// An upper bound of the length of the stream, in bytes.
    most: u64,
    word: Vec<u8>,
    /// Bytes that [`Self::peek`] has read ahead.
    ahead: Vec<u8>,
}

impl<'a> Scanner<'a> {
    /// Scans the decompressed file from its beginning.
    pub(crate) fn new(source: &'a Source) -> Self {
        let encoding = source.encoding();
        Self::of(source, source.reader(0, encoding), encoding.most(source.len()))
    }

    /// Scans any stream that belongs to the file. `most` bounds its length.
    pub(crate) fn of(source: &'a Source, reader: impl io::BufRead + 'a, most: u64) -> Self {
        Self {
            source,
            reader: Box::new(reader),
            line: 0,
            position: 0,
            most,
            word: Vec::new(),
            ahead: Vec::new(),
        }
    }

    /// Sets the number of lines read.
    pub(crate) fn after_lines(mut self, line: u64) -> Self {
        self.line = line;
        self
    }

    /// Scans the decompressed file from an offset, before which there are `line` lines.
    pub(crate) fn resume(source: &'a Source, offset: u64, line: u64) -> Result<Self> {
        if !source.is_gzip() {
            let scanner = Self::of(source, source.reader(offset, Encoding::Raw), source.len());
            return Ok(Self { position: offset, line, ..scanner });
        }
        let mut scanner = Self::new(source);
        scanner.skip(offset)?;
        Ok(scanner.after_lines(line))
    }

    /// Moves to another offset of the decompressed file, before which there are `line` lines. A compressed file is
    /// decompressed from its beginning only to move backwards.
    pub(crate) fn go_on(&mut self, offset: u64, line: u64) -> Result<()> {
        /// The distance up to which reading on is no slower than opening a new stream.
        const NEAR: u64 = 1 << 16;
        match offset.checked_sub(self.position) {
            Some(gap) if self.source.is_gzip() || gap <= NEAR => self.skip(gap)?,
            _ => *self = Self::resume(self.source, offset, line)?,
        }
        self.line = line;
        Ok(())
    }

    pub(crate) fn source(&self) -> &'a Source {
        self.source
    }

    /// Bytes read.
    pub(crate) fn position(&self) -> u64 {
        self.position
    }

    /// Returns the number of lines read; line breaks within binary blocks do not count.
    pub(crate) fn lines(&self) -> u64 {
        self.line
    }

    /// Returns an upper bound of the bytes still to come.
    pub(crate) fn available(&self) -> u64 {
        self.most.saturating_sub(self.position)
    }

    /// Returns an error about the current line.
    pub(crate) fn error(&self, rule: impl Into<String>) -> Error {
        self.source.error(format!("line {}", self.line + 1), rule)
    }

    /// Returns an error about the line before, which [`Self::next_line`] has returned.
    pub(crate) fn line_error(&self, rule: impl Into<String>) -> Error {
        self.source.error(format!("line {}", self.line.max(1)), rule)
    }

    fn advance(&mut self, bytes: usize) {
        if self.ahead.is_empty() {
            self.reader.consume(bytes);
        } else {
            self.ahead.drain(..bytes.min(self.ahead.len()));
        }
        self.position = self.position.saturating_add(num::wide(bytes));
    }

    fn fill(&mut self) -> Result<&[u8]> {
        if !self.ahead.is_empty() {
            return Ok(&self.ahead);
        }
        self.fill_stream()
    }

    fn fill_stream(&mut self) -> Result<&[u8]> {
        // Interrupted reads are repeated.
        while let Err(error) = self.reader.fill_buf() {
            if error.kind() != ErrorKind::Interrupted {
                return Err(stream_error(self.source, error));
            }
        }
        self.reader.fill_buf().map_err(|error| stream_error(self.source, error))
    }

    /// Consumes bytes and counts their line breaks. `take` returns how many bytes of a buffer it takes, and whether it
    /// wants no more. False at the end of the file.
    fn scan(&mut self, mut take: impl FnMut(&[u8]) -> (usize, bool)) -> Result<bool> {
        loop {
            let buffer = self.fill()?;
            if buffer.is_empty() {
                return Ok(false);
            }
            let (used, ended) = take(buffer);
            let lines = buffer[..used].iter().filter(|&&byte| byte == b'\n').count();
            self.line += num::wide(lines);
            self.advance(used);
            if ended {
                return Ok(true);
            }
        }
    }

    /// Reads the next line without its line end; None at the end of the file.
    ///
    /// # Errors
    ///
    /// If it is longer than 64 KiB.
    pub(crate) fn next_line(&mut self) -> Result<Option<String>> {
        let mut line = Vec::new();
        let ended = self.scan(|buffer| {
            let end = buffer.iter().position(|&byte| byte == b'\n');
            let text = end.unwrap_or(buffer.len());
            line.extend_from_slice(&buffer[..text]);
            let long = line.len() > MAX_LINE;
            (text + usize::from(end.is_some() && !long), end.is_some() || long)
        })?;
        if line.len() > MAX_LINE {
            return Err(self.error(format!("longer than {MAX_LINE} bytes")));
        }
        if !ended && line.is_empty() {
            return Ok(None);
        }
        // The last line may have no line end.
        self.line += u64::from(!ended);
        if line.last() == Some(&b'\r') {
            line.pop();
        }
        Ok(Some(String::from_utf8_lossy(&line).into_owned()))
    }

    /// Skips a line of any length. False at the end of the file.
    pub(crate) fn skip_line(&mut self) -> Result<bool> {
        let mut any = false;
        let ended = self.scan(|buffer| {
            any = true;
            let end = buffer.iter().position(|&byte| byte == b'\n');
            (end.map_or(buffer.len(), |end| end + 1), end.is_some())
        })?;
        self.line += u64::from(any && !ended);
        Ok(any)
    }

    /// Reads the next line that is not blank, trimmed.
    pub(crate) fn full_line(&mut self) -> Result<Option<String>> {
        while let Some(line) = self.next_line()? {
            let trimmed = line.trim();
            if !trimmed.is_empty() {
                return Ok(Some(trimmed.to_owned()));
            }
        }
        Ok(None)
    }

    /// Reads the next word between blanks; None at the end of the file.
    ///
    /// # Errors
    ///
    /// If it is longer than 256 bytes.
    pub(crate) fn word(&mut self) -> Result<Option<&str>> {
        self.skip_blanks()?;
        let mut word = std::mem::take(&mut self.word);
        word.clear();
        self.scan(|buffer| {
            let end = buffer.iter().position(u8::is_ascii_whitespace);
            let take = end.unwrap_or(buffer.len());
            word.extend_from_slice(&buffer[..take.min(MAX_WORD + 1)]);
            (take, end.is_some() || word.len() > MAX_WORD)
        })?;
        self.word = word;
        if self.word.len() > MAX_WORD {
            return Err(self.error(format!("a word longer than {MAX_WORD} bytes")));
        }
        if self.word.is_empty() {
            return Ok(None);
        }
        match std::str::from_utf8(&self.word) {
            Ok(word) => Ok(Some(word)),
            Err(_) => Err(self.error(format!("\"{}\": is not text", self.word.escape_ascii()))),
        }
    }

    /// Skips blanks and line ends.
    pub(crate) fn skip_blanks(&mut self) -> Result<()> {
        self.scan(|buffer| {
            let blanks = buffer.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
            (blanks, blanks < buffer.len())
        })
        .map(drop)
    }

    /// Returns the next `count` bytes, or all that are left, without consuming them.
    pub(crate) fn peek(&mut self, count: usize) -> Result<&[u8]> {
        while let Some(missing) = count.checked_sub(self.ahead.len()).filter(|&missing| missing > 0) {
            let piece = self.fill_stream()?;
            let piece = piece[..piece.len().min(missing)].to_vec();
            if piece.is_empty() {
                break;
            }
            self.reader.consume(piece.len());
            self.ahead.extend_from_slice(&piece);
        }
        Ok(&self.ahead[..self.ahead.len().min(count)])
    }

    /// Skips numbers up to the blank after the last one. Only the first character of each is checked.
    pub(crate) fn skip_numbers(&mut self, count: u64) -> Result<()> {
        // `nan` and `inf` are numbers too.
        let begins = |byte: u8| {
            byte.is_ascii_digit() || matches!(byte, b'+' | b'-' | b'.' | b'n' | b'N' | b'i' | b'I')
        };
        let (mut left, mut inside, mut wrong) = (count, false, false);
        let more = count == 0
            || self.scan(|buffer| {
                let mut used = 0;
                for &byte in buffer {
                    let blank = byte.is_ascii_whitespace();
                    wrong = !blank && !inside && !begins(byte);
                    left -= u64::from(blank && inside);
                    if wrong || left == 0 {
                        break;
                    }
                    inside = !blank;
                    used += 1;
                }
                (used, wrong || left == 0)
            })?;
        if wrong {
            let word = self.word()?.map(shown).unwrap_or_default();
            return Err(self.error(format!("\"{word}\": must be a number, {left} more are announced")));
        }
        left -= u64::from(!more && inside);
        if left > 0 {
            return Err(self.error(format!("ends here: {left} more numbers are announced")));
        }
        Ok(())
    }

    /// Reads the rest of the line, which must be blank.
    pub(crate) fn end_line(&mut self) -> Result<()> {
        match self.next_line()? {
            Some(rest) if !rest.trim().is_empty() => {
                let shown: String = rest.trim().chars().take(40).collect();
                Err(self.line_error(format!("\"{shown}\": must not follow here")))
            }
            _ => Ok(()),
        }
    }

    /// Reads the next word as a number; `what` names it in errors.
    pub(crate) fn number<T: FromStr>(&mut self, what: &str) -> Result<T> {
        match self.word()?.map(|word| word.parse().map_err(|_| word.to_owned())) {
            Some(Ok(number)) => Ok(number),
            Some(Err(word)) => Err(self.error(format!("\"{word}\": must be {what}"))),
            None => Err(self.error(format!("ends before {what}"))),
        }
    }

    /// Skips bytes.
    pub(crate) fn skip(&mut self, bytes: u64) -> Result<()> {
        let mut left = bytes;
        while left > 0 {
            let buffer = self.fill()?.len();
            if buffer == 0 {
                return Err(self.source.error(
                    format!("byte {}", self.position),
                    format!("ends here: {left} more bytes are announced"),
                ));
            }
            let take = buffer.min(usize::try_from(left).unwrap_or(usize::MAX));
            self.advance(take);
            left -= num::wide(take);
        }
        Ok(())
    }

    /// Skips everything up to and including a mark, whose first byte must occur in it only once. False if the file
    /// ends before one.
    pub(crate) fn pass(&mut self, mark: &[u8]) -> Result<bool> {
        let mut met = 0;
        self.scan(|buffer| {
            let mut used = 0;
            for &byte in buffer {
                used += 1;
                met = if byte == mark[met] { met + 1 } else { usize::from(byte == mark[0]) };
                if met == mark.len() {
                    break;
                }
            }
            (used, met == mark.len())
        })
    }

    /// Reads the following numbers as the little-endian bytes of a type.
    pub(crate) fn numbers(&mut self, kind: SampleType) -> impl Read {
        let size = usize::try_from(kind.bytes()).unwrap_or(8);
        NumberBytes::new(move || {
            let Some(word) = self.word().map_err(std::io::Error::other)? else { return Ok(None) };
            match to_bytes(word, kind) {
                Some(bytes) => Ok(Some((bytes, size))),
                None => {
                    let rule = format!("\"{word}\": must be a number of type {}", kind.name());
                    Err(std::io::Error::other(self.error(rule)))
                }
            }
        })
    }
}

impl Read for Scanner<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let got = if self.ahead.is_empty() {
            self.reader.read(buffer)?
        } else {
            let take = self.ahead.len().min(buffer.len());
            buffer[..take].copy_from_slice(&self.ahead[..take]);
            self.ahead.drain(..take);
            take
        };
        self.position = self.position.saturating_add(num::wide(got));
        Ok(got)
    }
}

impl io::BufRead for Scanner<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        if self.ahead.is_empty() { self.reader.fill_buf() } else { Ok(&self.ahead) }
    }

    fn consume(&mut self, bytes: usize) {
        self.advance(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan<T>(text: &[u8], check: impl Fn(&mut Scanner) -> T) -> T {
        let source = Source::in_memory(&[("a.txt", text)]).unwrap();
        check(&mut Scanner::new(&source))
    }

    #[test]
    fn lines_words_and_blocks_follow_each_other() {
        scan(b"first line\r\n  two 3\n\n\x00\x0a\x01tail 4.5", |s| {
            assert_eq!(s.next_line().unwrap().unwrap(), "first line");
            assert_eq!(s.word().unwrap(), Some("two"));
            assert_eq!(s.number::<u32>("a count").unwrap(), 3);
            s.end_line().unwrap();
            s.end_line().unwrap();
            let mut block = [9; 3];
            s.read_exact(&mut block).unwrap();
            assert_eq!(block, [0, 10, 1]);
            assert_eq!((s.position(), s.available()), (24, 8));
            s.skip(4).unwrap();
            assert_eq!(s.number::<f64>("a number").unwrap(), 4.5);
            assert_eq!(s.word().unwrap(), None);
            assert!(s.skip(1).unwrap_err().to_string().contains("byte 32: ends here"));
        });
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let text = |r: Result<u32>| r.unwrap_err().to_string();
        scan(b"one\ntwo", |s| {
            s.word().unwrap();
            assert_eq!(text(s.number("a count")), "a.txt: line 2: \"two\": must be a count");
            assert_eq!(text(s.number("a count")), "a.txt: line 2: ends before a count");
        });
        scan(b"1 2\n", |s| {
            s.word().unwrap();
            assert!(s.end_line().unwrap_err().to_string().contains("line 1: \"2\": must not follow"));
        });
        scan(&[b'x'; 300], |s| assert!(s.word().unwrap_err().to_string().contains("longer than 256")));
        scan(&[b'x'; 70_000], |s| assert!(s.next_line().unwrap_err().to_string().contains("65536")));
        scan(b"\xff\xfe ", |s| assert!(s.word().unwrap_err().to_string().contains("is not text")));
    }

    #[test]
    fn looking_ahead_passes_over_nothing() {
        // Longer than the buffer of a file, so that what is looked at lies on both sides of its end.
        let text = "12 34\n56 ".repeat(20_000);
        let packed = {
            let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
            std::io::Write::write_all(&mut encoder, text.as_bytes()).unwrap();
            encoder.finish().unwrap()
        };
        for bytes in [text.as_bytes(), &packed] {
            scan(bytes, |s| {
                let mut at = 0;
                for step in [0, 65_530, 40, 65_000, 49_416] {
                    s.skip(step).unwrap();
                    at += usize::try_from(step).unwrap();
                    let left = &text.as_bytes()[at..];
                    assert_eq!(s.peek(20).unwrap(), &left[..left.len().min(20)]);
                    assert_eq!(s.peek(5).unwrap(), &left[..left.len().min(5)]);
                    assert_eq!(s.position(), u64::try_from(at).unwrap());
                }
                assert_eq!(s.peek(20).unwrap(), b"4\n56 12 34\n56 ");
                assert_eq!(s.word().unwrap(), Some("4"));
                let mut rest = Vec::new();
                s.read_to_end(&mut rest).unwrap();
                assert_eq!(rest, b"\n56 12 34\n56 ");
                assert_eq!(s.peek(3).unwrap(), b"");
            });
            scan(bytes, |s| {
                s.skip_numbers(50_000).unwrap();
                assert_eq!((s.position(), s.lines()), (149_999, 16_666));
                assert_eq!(s.word().unwrap(), Some("56"));
                s.skip_numbers(9_999).unwrap();
                let text = s.skip_numbers(2).unwrap_err().to_string();
                assert!(text.ends_with("line 20001: ends here: 2 more numbers are announced"), "{text}");
                let place = (s.position(), s.lines());
                let mut again = Scanner::resume(s.source(), 149_999, 16_666).unwrap();
                assert_eq!(again.word().unwrap(), Some("56"));
                again.skip_numbers(9_999).unwrap();
                assert_eq!((again.position() + 1, again.lines()), place);
            });
        }
        scan(b"-nan +.5", |s| s.skip_numbers(2).unwrap());
        scan(b"1 2\n3 VECTORS\n4", |s| {
            let text = s.skip_numbers(5).unwrap_err().to_string();
            assert_eq!(text, "a.txt: line 2: \"VECTORS\": must be a number, 2 more are announced");
        });
        let lines = [&[b'x'; 70_000][..], b"\n\nlast"].concat();
        scan(&lines, |s| {
            let ends: Vec<(bool, u64)> = (0..4).map(|_| (s.skip_line().unwrap(), s.lines())).collect();
            assert_eq!(ends, [(true, 1), (true, 2), (true, 3), (false, 3)]);
        });
    }

    #[test]
    fn marks_are_passed_and_places_found_again() {
        let text = b"one\n$a$ab\n$abc end\n";
        scan(text, |s| {
            assert!(s.pass(b"$abc").unwrap());
            assert_eq!((s.position(), s.lines()), (14, 2));
            assert_eq!(s.word().unwrap(), Some("end"));
            assert!(!s.pass(b"$abc").unwrap());
        });
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut packed, text).unwrap();
        for bytes in [text.to_vec(), packed.finish().unwrap()] {
            let source = Source::in_memory(&[("a.txt", &bytes)]).unwrap();
            let mut s = Scanner::resume(&source, 14, 2).unwrap();
            assert_eq!(s.word().unwrap(), Some("end"));
            assert_eq!((s.position(), s.lines()), (18, 2));
            for (place, word) in [(18, None), (4, Some("$a$ab")), (6, Some("$ab")), (0, Some("one"))] {
                s.go_on(place, 7).unwrap();
                assert_eq!((s.position(), s.lines()), (place, 7));
                assert_eq!(s.word().unwrap(), word);
            }
        }
    }

    #[test]
    fn numbers_become_bytes_of_their_type() {
        let bytes = |text: &[u8], kind| {
            scan(text, |s| {
                let mut bytes = Vec::new();
                let source = s.source();
                s.numbers(kind).read_to_end(&mut bytes).map(|_| bytes).map_err(|e| source.io_error(e))
            })
        };
        assert_eq!(bytes(b"1 2\n255", SampleType::U8).unwrap(), [1, 2, 255]);
        assert_eq!(bytes(b"-2", SampleType::I16).unwrap(), (-2_i16).to_le_bytes());
        let floats = bytes(b"1.5 nan -inf 1.e2 -nan(ind)", SampleType::F32).unwrap();
        let floats: Vec<f32> = floats.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
        assert_eq!((floats[0], floats[2], floats[3]), (1.5, f32::NEG_INFINITY, 100.0));
        assert!(floats[1].is_nan() && floats[4].is_nan());
        let text = bytes(b"1\n256", SampleType::U8).unwrap_err().to_string();
        assert_eq!(text, "a.txt: line 2: \"256\": must be a number of type u8");
        assert!(bytes(b"1.5", SampleType::I32).is_err());
    }
}
