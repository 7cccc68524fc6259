#pragma once

#include <string>
#include <vector>

#include <sidestep/plugin/schema.hpp>
#include <sidestep/runtime/host.hpp>

namespace sidestep {

/// Type, unit, size, choices, range and default of a parameter on one line, e.g. "number [m], at
/// least 0, default 0.8".
[[nodiscard]] std::string parameter_summary(const Parameter& parameter);

/// What a mapper offers or a field needs, as a sentence; empty where there is nothing to say.
[[nodiscard]] std::string views_sentence(const PluginInfo& plugin);

/// The reference page of plugins: every parameter of each, as Markdown.
[[nodiscard]] std::string reference_markdown(const std::vector<PluginInfo>& plugins);

/// A JSON Schema (draft 2020-12) of configurations that use these plugins, for editors: each
/// plugin block may be any plugin of its kind with that plugin's parameters.
[[nodiscard]] std::string configuration_json_schema(const std::vector<PluginInfo>& plugins);

}  // namespace sidestep
