//! Debug names, labels, and the messages of the validation layer.

use std::ffi::{CStr, CString, c_void};
use std::sync::{Mutex, MutexGuard, PoisonError};

use ash::vk;

pub(super) const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Messages of the validation layer, its checks of synchronisation inside a command buffer included.
///
/// Those checks take a dispatch to touch all of what it is bound to: two dispatches that write disjoint parts of
/// a resource without a barrier between them belong in two submissions.
///
/// Every warning and error is kept until [taken](Self::take), and also sent to `tracing`.
#[derive(Debug)]
pub struct ValidationLog {
    active: bool,
    messages: Mutex<Vec<String>>,
}

impl ValidationLog {
    pub(super) fn new(active: bool) -> Self {
        Self { active, messages: Mutex::default() }
    }

    /// Whether the validation layer is loaded.
    #[must_use]
    pub fn is_active(&self) -> bool {
        self.active
    }

    /// The messages since the last call.
    #[must_use]
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut self.lock())
    }

    fn lock(&self) -> MutexGuard<'_, Vec<String>> {
        self.messages.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Describes the messenger that fills `log`, which must outlive it.
pub(super) fn messenger_info(log: &ValidationLog) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(
            vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
        )
        .message_type(
            vk::DebugUtilsMessageTypeFlagsEXT::GENERAL
                | vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
        )
        .pfn_user_callback(Some(on_message))
        .user_data(std::ptr::from_ref(log).cast_mut().cast())
}

unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    log: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the loader passes valid, nul-terminated strings for the time of the call, and `log` is the
    // `ValidationLog` given to `messenger_info`, which lives as long as the instance.
    let (log, id, text) = unsafe {
        let data = &*data;
        (&*log.cast::<ValidationLog>().cast_const(), text(data.p_message_id_name), text(data.p_message))
    };
    // GENERAL is the loader's own: drivers that did not start, layers it skipped.
    let general = kind == vk::DebugUtilsMessageTypeFlagsEXT::GENERAL;
    // Images stay in GENERAL on purpose: no layout transitions, and no difference on current devices. A wrong
    // layout has the same id, as a message of type VALIDATION.
    let layout_advice = kind == vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE
        && id == "UNASSIGNED-CoreValidation-DrawState-InvalidImageLayout";
    if general || layout_advice {
        tracing::debug!("{id}: {text}");
    } else {
        if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) {
            tracing::error!("{id}: {text}");
        } else {
            tracing::warn!("{id}: {text}");
        }
        log.lock().push(format!("{id}: {text}"));
    }
    vk::FALSE
}

/// # Safety
///
/// `p` is null or a nul-terminated string.
unsafe fn text(p: *const std::ffi::c_char) -> String {
    if p.is_null() {
        return String::new();
    }
    // SAFETY: by the caller's promise.
    unsafe { CStr::from_ptr(p) }.to_string_lossy().into_owned()
}

/// A C string of `name`, cut at its first nul.
pub(super) fn c_name(name: &str) -> CString {
    let end = name.find('\0').unwrap_or(name.len());
    CString::new(&name[..end]).unwrap_or_default()
}
