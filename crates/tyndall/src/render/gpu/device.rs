//! Graphics cards: which there are, and one of them opened. What goes wrong on it becomes an error at the next wait.

use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use crate::error::{Error, Result};
use crate::progress::Progress;

/// What an adapter is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A card of its own.
    Discrete,
    /// Part of the processor, sharing its memory.
    Integrated,
    /// A share of a card.
    Virtual,
    /// A program that does what a card would.
    Software,
    /// Not told.
    Other,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Discrete => "discrete",
            Self::Integrated => "integrated",
            Self::Virtual => "virtual",
            Self::Software => "software",
            Self::Other => "other",
        })
    }
}

/// What is told of an adapter.
#[derive(Clone, Debug)]
pub struct AdapterInfo {
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// Name and version of its driver.
    pub driver: String,
    /// Memory of its own, in bytes; none if its driver does not tell.
    pub memory_bytes: Option<u64>,
    /// The most that a shader sees through one binding, in bytes.
    pub binding_bytes: u64,
    /// The most that one buffer holds, in bytes.
    pub buffer_bytes: u64,
}

impl AdapterInfo {
    fn of(adapter: &wgpu::Adapter) -> Self {
        let info = adapter.get_info();
        let limits = adapter.limits();
        Self {
            name: info.name,
            kind: match info.device_type {
                wgpu::DeviceType::DiscreteGpu => Kind::Discrete,
                wgpu::DeviceType::IntegratedGpu => Kind::Integrated,
                wgpu::DeviceType::VirtualGpu => Kind::Virtual,
                wgpu::DeviceType::Cpu => Kind::Software,
                wgpu::DeviceType::Other => Kind::Other,
            },
            driver: [info.driver, info.driver_info].join(" ").trim().to_string(),
            memory_bytes: memory_bytes(adapter),
            binding_bytes: limits.max_storage_buffer_binding_size,
            buffer_bytes: limits.max_buffer_size,
        }
    }

    /// Whether it is hardware: what `auto` takes.
    pub fn is_hardware(&self) -> bool {
        matches!(self.kind, Kind::Discrete | Kind::Integrated | Kind::Virtual)
    }
}

/// The largest memory of the adapter's own, in bytes.
#[expect(unsafe_code, reason = "the driver is asked for what wgpu does not pass on")]
fn memory_bytes(adapter: &wgpu::Adapter) -> Option<u64> {
    /// Of a heap: it is the device's own.
    const DEVICE_LOCAL: u32 = 1;
    // SAFETY: the handle is not destroyed: it is borrowed while the adapter lives.
    let hal = unsafe { adapter.as_hal::<wgpu::hal::api::Vulkan>() }?;
    let instance = hal.shared_instance().raw_instance();
    // SAFETY: the physical device belongs to this instance, which lives as long as the adapter.
    let memory = unsafe { instance.get_physical_device_memory_properties(hal.raw_physical_device()) };
    let heaps = &memory.memory_heaps[..memory.memory_heap_count as usize];
    heaps.iter().filter(|heap| heap.flags.as_raw() & DEVICE_LOCAL != 0).map(|heap| heap.size).max()
}

fn instance() -> wgpu::Instance {
    wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::VULKAN,
        flags: wgpu::InstanceFlags::empty(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    })
}

/// All adapters, hardware first: cards of their own, then those in the processor.
fn sorted_adapters() -> Vec<wgpu::Adapter> {
    let mut adapters = pollster::block_on(instance().enumerate_adapters(wgpu::Backends::VULKAN));
    adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::VirtualGpu => 1,
        wgpu::DeviceType::IntegratedGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    adapters
}

/// The adapters of this machine, in the order in which they are taken. None without a driver.
pub fn adapters() -> Vec<AdapterInfo> {
    sorted_adapters().iter().map(AdapterInfo::of).collect()
}

/// Which adapter to open, and how.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Part of the adapter's name, in any case; without one the first.
    pub name: Option<String>,
    /// Takes no software adapter.
    pub hardware_only: bool,
    /// The most bytes of a page of the scene's arrays, if less than a binding allows.
    pub page_bytes: Option<u64>,
    /// Has shaders check indices and loops. Without that they take a third less time: what they read is what this library has written.
    pub checked: bool,
}

/// A device, ready to work; a clone is the same device.
#[derive(Clone)]
pub struct Gpu {
    pub(super) device: wgpu::Device,
    queue: wgpu::Queue,
    info: AdapterInfo,
    limits: wgpu::Limits,
    options: Options,
    pipelines: Arc<Mutex<Pipelines>>,
    fault: Arc<Mutex<Option<Error>>>,
    timed: bool,
}

/// Kernels that were made, by text and entry point.
type Pipelines = HashMap<(String, &'static str), wgpu::ComputePipeline>;

/// How long the device may take for what was given to it at one time, before it counts as lost.
const PATIENCE: Duration = Duration::from_secs(120);

impl Gpu {
    /// Opens an adapter. Fails with [`Error::Device`] if there is none, or none of that name.
    pub fn open(options: Options) -> Result<Self> {
        let mut found = sorted_adapters();
        let names: Vec<String> = found.iter().map(|adapter| adapter.get_info().name).collect();
        let wanted = options.name.as_deref().map(str::to_lowercase);
        found.retain(|adapter| {
            let info = AdapterInfo::of(adapter);
            let is_named = wanted.as_deref().is_none_or(|name| info.name.to_lowercase().contains(name));
            is_named && (!options.hardware_only || info.is_hardware())
        });
        let Some(adapter) = found.into_iter().next() else {
            return Err(Error::Device(match &options.name {
                Some(name) if !names.is_empty() => {
                    format!("no GPU adapter is called '{name}' — there are: {}", names.join(", "))
                }
                _ if options.hardware_only || names.is_empty() => "no GPU adapter".into(),
                _ => "no GPU adapter that fits".into(),
            }));
        };
        let info = AdapterInfo::of(&adapter);
        let limits = adapter.limits();
        let timed = adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let descriptor = wgpu::DeviceDescriptor {
            label: None,
            required_features: if timed { wgpu::Features::TIMESTAMP_QUERY } else { wgpu::Features::empty() },
            required_limits: limits.clone(),
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| Error::Device(format!("{} does not open: {error}", info.name)))?;
        let fault = Arc::new(Mutex::new(None));
        let (uncaptured, lost) = (fault.clone(), fault.clone());
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            keep_first(&uncaptured, Error::Device(one_line(&error.to_string())));
        }));
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                keep_first(&lost, Error::Device(format!("the GPU was lost: {}", one_line(&message))));
            }
        });
        Ok(Self { device, queue, info, limits, options, pipelines: Arc::default(), fault, timed })
    }

    /// What it is.
    pub fn info(&self) -> &AdapterInfo {
        &self.info
    }

    /// Whether work is timed on the card itself.
    pub fn is_timed(&self) -> bool {
        self.timed
    }

    /// The most that a shader sees through one binding, in bytes.
    pub(super) fn binding_bytes(&self) -> u64 {
        self.limits.max_storage_buffer_binding_size.min(self.limits.max_buffer_size)
    }

    /// The most that a page of an array has, in bytes.
    pub(super) fn page_bytes(&self) -> u64 {
        let allowed = self.binding_bytes();
        self.options.page_bytes.map_or(allowed, |bytes| bytes.clamp(16, allowed))
    }

    /// How many storage buffers a kernel sees.
    pub(crate) fn storage_buffers(&self) -> u64 {
        self.limits.max_storage_buffers_per_shader_stage.into()
    }

    /// How many threads a workgroup may have.
    pub fn workgroup_threads(&self) -> u32 {
        self.limits.max_compute_invocations_per_workgroup
    }

    /// A buffer without content. Fails with [`Error::Memory`] if the card has no room for it.
    pub(super) fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer> {
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let descriptor =
            wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        let buffer = self.device.create_buffer(&descriptor);
        match pollster::block_on(scope.pop()) {
            None => Ok(buffer),
            Some(_) => Err(self.too_small(label, size)),
        }
    }

    /// That something does not fit.
    pub(super) fn too_small(&self, what: &str, needed_bytes: u64) -> Error {
        Error::Memory {
            what: format!("{what} on {}", self.info.name),
            needed_bytes,
            available_bytes: self.info.memory_bytes.unwrap_or(0),
            hint: "use --device cpu, or --pack for fewer bytes a particle".into(),
        }
    }

    /// Writes into a buffer; what is written is taken over at once.
    pub(super) fn write(&self, buffer: &wgpu::Buffer, offset: u64, bytes: &[u8]) {
        self.queue.write_buffer(buffer, offset, bytes);
    }

    /// Waits until all that was written has arrived.
    pub(super) fn flush(&self) -> Result<()> {
        let submitted = self.queue.submit([]);
        self.wait(submitted)
    }

    /// Buffers behind the bindings of a layout, in order.
    pub(super) fn bind(&self, layout: &wgpu::BindGroupLayout, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
        let entries: Vec<_> = (0..)
            .zip(buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
    }

    /// Waits, and reads back a range of bytes of a buffer as records.
    pub(super) fn read<T: bytemuck::AnyBitPattern, R>(
        &self,
        buffer: &wgpu::Buffer,
        range: std::ops::Range<u64>,
        take: impl FnOnce(&[T]) -> R,
    ) -> Result<R> {
        let size = range.end - range.start;
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let copy = self.buffer("what is read back", size, usage)?;
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, range.start, &copy, 0, size);
        let submitted = self.submit(encoder);
        // What fails is told by the wait, or by the range that is not there.
        copy.slice(..).map_async(wgpu::MapMode::Read, |_| ());
        self.wait(submitted)?;
        let mapped = copy.get_mapped_range(..);
        let mapped = mapped.map_err(|error| Error::Device(one_line(&error.to_string())))?;
        Ok(take(bytemuck::cast_slice(&mapped)))
    }

    /// Submits what was encoded.
    pub(super) fn submit(&self, encoder: wgpu::CommandEncoder) -> wgpu::SubmissionIndex {
        self.queue.submit([encoder.finish()])
    }

    /// Waits for what was submitted, and tells what has gone wrong on the card since the last wait.
    pub(super) fn wait(&self, submitted: wgpu::SubmissionIndex) -> Result<()> {
        let waited = self
            .device
            .poll(wgpu::PollType::Wait { submission_index: Some(submitted), timeout: Some(PATIENCE) });
        if let Some(fault) = self.fault.lock().unwrap_or_else(PoisonError::into_inner).take() {
            return Err(fault);
        }
        match waited {
            Ok(_) => Ok(()),
            Err(error) => Err(Error::Device(format!(
                "{} does not answer: {} — use --device cpu",
                self.info.name,
                one_line(&error.to_string())
            ))),
        }
    }

    /// Seconds of a tick of the card's clock.
    pub(super) fn tick_secs(&self) -> f64 {
        f64::from(self.queue.get_timestamp_period()) * 1e-9
    }

    /// The kernel `entry` of a text, made at most once; `progress` is told when it has to be made.
    pub(super) fn pipeline(
        &self,
        text: String,
        entry: &'static str,
        layout: &wgpu::PipelineLayout,
        progress: &dyn Progress,
    ) -> Result<wgpu::ComputePipeline> {
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (text, entry);
        if let Some(pipeline) = pipelines.get(&key) {
            return Ok(pipeline.clone());
        }
        if pipelines.is_empty() {
            progress.begin("compiling shaders", None, "");
        }
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let module = self.module(entry, &key.0);
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: Some(layout),
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions {
                // The kernels write before they read.
                zero_initialize_workgroup_memory: false,
                ..Default::default()
            },
            cache: None,
        });
        if let Some(error) = pollster::block_on(scope.pop()) {
            let text = one_line(&error.to_string());
            return Err(Error::Device(format!("{} refuses the kernel {entry}: {text}", self.info.name)));
        }
        pipelines.insert(key, pipeline.clone());
        Ok(pipeline)
    }

    #[expect(unsafe_code, reason = "shaders without checks of their own take a third less time")]
    fn module(&self, label: &str, text: &str) -> wgpu::ShaderModule {
        let descriptor = wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        };
        if self.options.checked {
            return self.device.create_shader_module(descriptor);
        }
        // SAFETY: every index into an array is below its length by the kernel's own arithmetic (that of a sort is a sum of counts of what is
        // sorted, an id is what the first kernel of a build wrote), or comes from the hierarchy as the builder wrote it and `Content` has
        // copied it whole; every loop ends, since its stack or mask loses an entry that is not put back, or it has a bound. The
        // tests run the same kernels with checks, and compare.
        unsafe {
            self.device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked())
        }
    }
}

/// Keeps what went wrong first: the rest follows from it.
fn keep_first(fault: &Mutex<Option<Error>>, error: Error) {
    fault.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
}

/// A message without its line breaks.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
