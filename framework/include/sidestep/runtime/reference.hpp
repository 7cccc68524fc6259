#pragma once

#include <string>
#include <vector>

#include <sidestep/plugin/schema.hpp>
#include <sidestep/runtime/host.hpp>

namespace sidestep {

/// A top-level block of configurations that is not a plugin's.
struct SettingsBlock {
  std::string key;  ///< E.g. "experiment".
  std::string doc;  ///< One line.
  Schema schema;
  std::string type;  ///< Of an experiment, e.g. "plan"; else empty.
};

/// Type, unit, size, choices, range and default of a parameter on one line, e.g. "number [m], at
/// least 0, default 0.8".
[[nodiscard]] std::string parameter_summary(const Parameter& parameter);

/// What a mapper offers or a field needs, as a sentence; empty where there is nothing to say.
[[nodiscard]] std::string views_sentence(const PluginInfo& plugin);

/// The reference page: every parameter of every plugin and block, as Markdown.
[[nodiscard]] std::string reference_markdown(const std::vector<PluginInfo>& plugins,
                                             const std::vector<SettingsBlock>& blocks);

/// A JSON Schema (draft 2020-12) of configurations that use these plugins, for editors: each
/// plugin block may be any plugin of its kind with that plugin's parameters.
[[nodiscard]] std::string configuration_json_schema(const std::vector<PluginInfo>& plugins,
                                                    const std::vector<SettingsBlock>& blocks);

}  // namespace sidestep
