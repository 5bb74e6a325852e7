//! Size and depth of a JPEG stream, read before a decoder allocates memory for it.

/// The frame of a JPEG stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Frame {
    pub(crate) bits: u8,
    pub(crate) width: u16,
    pub(crate) height: u16,
    pub(crate) components: u8,
}

/// Finds the only frame of a stream, up to the end of its image; the error says why there is none, or more than one.
pub(crate) fn frame(bytes: &[u8]) -> Result<Frame, &'static str> {
    let (mut found, mut scanned, mut at) = (None, false, 0);
    while let Some(&byte) = bytes.get(at) {
        let marker = match bytes.get(at + 1) {
            Some(&marker) if byte == 0xff && marker != 0xff => marker,
            // Coded samples, padding or fill bytes.
            _ => {
                at += 1;
                continue;
            }
        };
        at += 2;
        match marker {
            // Bytes after the end of the image are ignored.
            0xd9 if scanned => break,
            0 | 1 | 0xd0..=0xd9 => {}
            _ => {
                let Some(&[high, low]) = bytes.get(at..at + 2) else {
                    return Err("it ends within a marker");
                };
                let length = usize::from(u16::from_be_bytes([high, low])).max(2);
                let Some(segment) = bytes.get(at + 2..at + length) else {
                    return Err("a segment ends after the stream");
                };
                // DHT, DAC and JPG markers do not start a frame.
                if matches!(marker, 0xc0..=0xcf) && !matches!(marker, 0xc4 | 0xc8 | 0xcc) {
                    let &[bits, h1, h0, w1, w0, components, ..] = segment else {
                        return Err("its frame is too short");
                    };
                    if found.is_some() {
                        return Err("it has several frames");
                    }
                    let (height, width) = (u16::from_be_bytes([h1, h0]), u16::from_be_bytes([w1, w0]));
                    found = Some(Frame { bits, width, height, components });
                }
                scanned |= marker == 0xda;
                at += length;
            }
        }
    }
    found.ok_or("it has no frame")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_frame_is_found() {
        let start = [0xff, 0xd8, 0xff, 0xe0, 0, 4, 0xff, 0xc0];
        let sof = [0xff, 0xff, 0xc3, 0, 11, 16, 0, 5, 1, 4, 1, 0, 0x11, 0];
        let scan = [0xff, 0xda, 0, 3, 1, 9, 0xff, 0, 7, 0xff, 0xd3, 8, 0xff, 0xd9, 0];
        let whole = [&start[..], &sof, &scan].concat();
        let wanted = Frame { bits: 16, width: 260, height: 5, components: 1 };
        assert_eq!(frame(&whole), Ok(wanted));
        assert_eq!(frame(&[&start[..], &scan].concat()), Err("it has no frame"));
        assert_eq!(frame(&[&whole[..], &sof].concat()), Ok(wanted), "behind the end");
        assert_eq!(frame(&[&start[..], &sof, &[0xff, 0xd9], &sof].concat()), Err("it has several frames"));
        assert_eq!(frame(&whole[..16]), Err("a segment ends after the stream"));
        assert_eq!(frame(&[0xff, 0xc0, 0, 3, 1]), Err("its frame is too short"));
        assert_eq!(frame(&[0xff, 0xc0, 0]), Err("it ends within a marker"));
    }
}
