#pragma once

namespace sidestep {

/// Runs `command` in a process of its own, so that whatever a plugin does to that, somebody is left
/// to say which plugin it was, after which frame, and where the results are. A library that ends
/// the process as it is opened is refused, and the command begins anew. The exit code: the
/// command's own, kPlugin where a plugin ended it, kFault where something else did; ended by
/// another signal, as Ctrl-C, this process ends by it, too. Where a debugger looks on, or
/// SIDESTEP_SUPERVISE is 0, runs it here. [main], before any other thread.
[[nodiscard]] int supervise(int (*command)(int, char**), int argc, char** argv);

}  // namespace sidestep
