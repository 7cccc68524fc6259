#include <algorithm>
#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

#include <sidestep/experiments/experiments.hpp>
#include <sidestep/runtime/not_built.hpp>
#include <sidestep/runtime/reference.hpp>

#include "commands.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

Json to_json(const Schema& schema) {
  Json list = Json::array();
  for (const Parameter& parameter : schema) {
    Json json = {{"name", parameter.name},
                 {"type", to_string(parameter.type)},
                 {"doc", parameter.doc},
                 {"required", parameter.required}};
    if (!parameter.unit.empty()) json["unit"] = parameter.unit;
    if (!parameter.required) json["default"] = parameter.default_text;
    if (std::isfinite(parameter.min)) json["min"] = parameter.min;
    if (std::isfinite(parameter.max)) json["max"] = parameter.max;
    if (!parameter.choices.empty()) json["choices"] = parameter.choices;
    if (parameter.size) json["size"] = *parameter.size;
    if (!parameter.parameters.empty()) json["parameters"] = to_json(parameter.parameters);
    list.push_back(std::move(json));
  }
  return list;
}

Json to_json(const PluginInfo& plugin) {
  return {{"kind", to_string(plugin.kind)},      {"name", plugin.name},
          {"version", plugin.version},           {"doc", plugin.doc},
          {"library", plugin.library},           {"views", plugin.views},
          {"parameters", to_json(plugin.schema)}};
}

void print_parameters(const Schema& schema, int indent) {
  for (const Parameter& parameter : schema) {
    std::printf("%*s%s: %s\n", indent, "", parameter.name.c_str(),
                parameter_summary(parameter).c_str());
    std::printf("%*s%s\n", indent + 4, "", parameter.doc.c_str());
    print_parameters(parameter.parameters, indent + 4);
  }
}

void print_list(const std::vector<PluginInfo>& plugins) {
  std::size_t widest = 0;
  for (const PluginInfo& plugin : plugins) widest = std::max(widest, plugin.name.size());
  for (const PluginInfo& plugin : plugins) {
    std::printf("%-10s %-*s  %-8s %s\n", std::string(to_string(plugin.kind)).c_str(),
                static_cast<int>(widest), plugin.name.c_str(), plugin.version.c_str(),
                plugin.doc.c_str());
  }
}

/// Plugins that this build has not, and no other folder on the search path has either.
std::vector<NotBuiltPlugin> left_out(const std::vector<PluginInfo>& plugins) {
  auto all = plugins_not_built(host_plugin_paths({}, install_layout()));
  std::erase_if(all, [&](const NotBuiltPlugin& absent) {
    return std::ranges::any_of(plugins, [&](const PluginInfo& plugin) {
      return plugin.name == absent.name && to_string(plugin.kind) == absent.kind;
    });
  });
  return all;
}

void print_left_out(const std::vector<PluginInfo>& plugins) {
  for (const NotBuiltPlugin& plugin : left_out(plugins)) {
    std::printf("%-10s %s\n", plugin.kind.c_str(), how_to_build(plugin).c_str());
  }
}

ExitCode print_unknown(const std::string& name, const std::vector<PluginInfo>& plugins) {
  std::vector<std::string> names;
  for (const PluginInfo& plugin : plugins) names.push_back(plugin.name);
  std::string hint = did_you_mean(name, names, "`sidestep plugins` lists those that are there");
  for (const NotBuiltPlugin& plugin : left_out(plugins)) {
    if (plugin.name == name) hint = how_to_build(plugin);
  }
  print_errors({Error{ErrorCode::kPlugin, "there is no plugin '" + name + "'", "", hint, nullptr}});
  return ExitCode::kPlugin;
}

}  // namespace

ExitCode plugins_command(const std::optional<std::string>& name, PluginsFormat format) {
  Console console;
  Session session(RunSettings{.threads = 1}, &console);
  if (format == PluginsFormat::kResults) {
    const auto page = results_markdown(session.host());
    if (!page) {
      print_errors({page.error()});
      return exit_code(page.error());
    }
    std::printf("%s", page->c_str());
    return ExitCode::kSuccess;
  }
  const std::vector<PluginInfo>& plugins = session.host().plugins();
  std::vector<PluginInfo> wanted;
  std::ranges::copy_if(plugins, std::back_inserter(wanted),
                       [&](const PluginInfo& plugin) { return !name || plugin.name == *name; });
  for (const PluginRejection& rejection : session.host().rejections()) {
    console.warn(rejection.library.string() + " is not usable: " + rejection.error.describe());
  }
  if (name && wanted.empty()) return print_unknown(*name, plugins);
  const std::vector<SettingsBlock> blocks =
      name ? std::vector<SettingsBlock>{} : settings_blocks(session.host());
  if (format == PluginsFormat::kMarkdown) {
    std::printf("%s", reference_markdown(wanted, blocks).c_str());
  } else if (format == PluginsFormat::kJsonSchema) {
    std::printf("%s\n", configuration_json_schema(wanted, blocks).c_str());
  } else if (format == PluginsFormat::kJson) {
    Json list = Json::array();
    for (const PluginInfo& plugin : wanted) list.push_back(to_json(plugin));
    std::printf("%s\n", list.dump(2).c_str());
  } else if (!name) {
    print_list(wanted);
    print_left_out(plugins);
  } else {
    for (const PluginInfo& plugin : wanted) {
      std::printf("%s plugin '%s', version %s\n%s.\n%s%s%s\n\n",
                  std::string(to_string(plugin.kind)).c_str(), plugin.name.c_str(),
                  plugin.version.c_str(), plugin.doc.c_str(), views_sentence(plugin).c_str(),
                  plugin.views.empty() ? "" : "\n", plugin.library.c_str());
      print_parameters(plugin.schema, 0);
    }
  }
  return ExitCode::kSuccess;
}

}  // namespace sidestep
