//! The vertices of a page in one array, of which some may be on the device already.

use bytemuck::cast_slice;
use hdtrapeze_core::grid::PlanarMesh;
use wgpu::BufferUsages as Usage;

use super::early::There;
use super::scene::upload;
use super::{Device, GpuError};

/// See the module's text.
#[derive(Debug, Default)]
pub(crate) struct Vertices {
    /// Coordinates that only the host has, without gaps where others are.
    here: Vec<f32>,
    /// The others, each with how many of the host's come before.
    there: Vec<(usize, There)>,
    len: usize,
}

impl Vertices {
    /// Coordinates of all.
    pub fn len(&self) -> usize {
        self.len
    }

    /// True where some are on the device.
    pub fn are_early(&self) -> bool {
        !self.there.is_empty()
    }

    /// Adds those of a mesh, which may be on the device.
    pub fn add(&mut self, mesh: &PlanarMesh, there: Option<There>) {
        let vertices = mesh.floats();
        match there {
            Some(there) => self.there.push((self.here.len(), there)),
            None => self.here.extend_from_slice(vertices),
        }
        self.len += vertices.len();
    }

    /// Makes the array on the device, of no more than `most` bytes.
    pub fn upload(self, device: &Device, most: u64) -> Result<wgpu::Buffer, GpuError> {
        const WHAT: &str = "vertices";
        if self.there.is_empty() {
            return upload(device, most, WHAT, cast_slice(&self.here));
        }
        let bytes = (self.len * size_of::<f32>()) as u64;
        if bytes > most {
            return Err(device.too_large(WHAT, bytes, most));
        }
        let usage = Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC;
        let buffer = device.buffer(WHAT, bytes.max(64), usage)?;
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let (mut from, mut to) = (0, 0);
        let there = self.there.iter().map(|(end, there)| (*end, Some(there)));
        for (end, there) in there.chain([(self.here.len(), None)]) {
            let here: &[u8] = cast_slice(&self.here[from..end]);
            if !here.is_empty() {
                device.queue.write_buffer(&buffer, to, here);
            }
            from = end;
            to += here.len() as u64;
            if let Some(There {
                buffer: chunk,
                bytes,
            }) = there
            {
                let count = bytes.end - bytes.start;
                encoder.copy_buffer_to_buffer(chunk, bytes.start, &buffer, to, count);
                to += count;
            }
        }
        // Trees need their room.
        drop(self);
        device.wait(device.queue.submit([encoder.finish()]))?;
        Ok(buffer)
    }
}
