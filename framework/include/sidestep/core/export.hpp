#pragma once

/// Marks what must stay visible across shared libraries when a plugin is compiled with
/// hidden visibility: interfaces, and the types asked for with dynamic_cast.
#define SIDESTEP_EXPORT __attribute__((visibility("default")))
