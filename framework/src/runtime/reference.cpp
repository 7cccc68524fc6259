#include <sidestep/runtime/reference.hpp>

#include <cmath>
#include <sstream>

#include <nlohmann/json.hpp>

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

/// Text for a cell of a Markdown table.
std::string cell(std::string text) {
  for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2) {
    text.insert(at, "\\");
  }
  return text;
}

void write_rows(std::ostringstream& out, const Schema& schema, const std::string& prefix) {
  for (const Parameter& parameter : schema) {
    const std::string name = prefix + parameter.name;
    out << "| `" << name << "` | " << cell(parameter_summary(parameter)) << " | "
        << cell(parameter.doc) << " |\n";
    write_rows(out, parameter.parameters,
               name + (parameter.type == ParameterType::kObjects ? "[]." : "."));
  }
}

void write_table(std::ostringstream& out, const Schema& schema) {
  if (schema.empty()) return;
  out << "\n| parameter | type | meaning |\n| --- | --- | --- |\n";
  write_rows(out, schema, "");
}

Json schema_of_map(const Schema& schema);

Json schema_of(const Parameter& parameter) {
  const auto scalar = [&](const char* type) {
    Json json = {{"type", type}};
    if (std::isfinite(parameter.min)) json["minimum"] = parameter.min;
    if (std::isfinite(parameter.max)) json["maximum"] = parameter.max;
    return json;
  };
  const auto list = [&](Json items) {
    Json json = {{"type", "array"}, {"items", std::move(items)}};
    if (parameter.size) json["minItems"] = json["maxItems"] = *parameter.size;
    return json;
  };
  Json json = Json::object();
  switch (parameter.type) {
    case ParameterType::kBool: json = {{"type", "boolean"}}; break;
    case ParameterType::kInt: json = scalar("integer"); break;
    case ParameterType::kDouble: json = scalar("number"); break;
    case ParameterType::kString:
    case ParameterType::kPath: json = {{"type", "string"}}; break;
    case ParameterType::kChoice: json = {{"enum", parameter.choices}}; break;
    case ParameterType::kDoubles: json = list(scalar("number")); break;
    case ParameterType::kInts: json = list(scalar("integer")); break;
    case ParameterType::kStrings: json = list({{"type", "string"}}); break;
    case ParameterType::kObject: json = schema_of_map(parameter.parameters); break;
    case ParameterType::kObjects: json = list(schema_of_map(parameter.parameters)); break;
    case ParameterType::kNode: break;
  }
  json["description"] =
      parameter.unit.empty() ? parameter.doc : parameter.doc + " [" + parameter.unit + "]";
  return json;
}

Json schema_of_map(const Schema& schema) {
  Json properties = Json::object();
  Json required = Json::array();
  for (const Parameter& parameter : schema) {
    properties[parameter.name] = schema_of(parameter);
    if (parameter.required) required.push_back(parameter.name);
  }
  Json json = {{"type", "object"}, {"properties", properties}, {"additionalProperties", false}};
  if (!required.empty()) json["required"] = required;
  return json;
}

}  // namespace

std::string parameter_summary(const Parameter& parameter) {
  std::string line = parameter.plugin ? std::string(to_string(*parameter.plugin)) + " plugin"
                                      : std::string(to_string(parameter.type));
  if (!parameter.unit.empty()) line += " [" + parameter.unit + "]";
  if (parameter.size) line += ", " + std::to_string(*parameter.size) + " values";
  for (std::size_t i = 0; i < parameter.choices.size(); ++i) {
    line += (i == 0 ? ": " : " | ") + parameter.choices[i];
  }
  const bool has_min = std::isfinite(parameter.min);
  const bool has_max = std::isfinite(parameter.max);
  if (has_min && has_max) {
    line += ", " + detail::number_text(parameter.min) + " to " + detail::number_text(parameter.max);
  } else if (has_min) {
    line += ", at least " + detail::number_text(parameter.min);
  } else if (has_max) {
    line += ", at most " + detail::number_text(parameter.max);
  }
  return line + (parameter.required ? ", required" : ", default " + parameter.default_text);
}

std::string views_sentence(const PluginInfo& plugin) {
  if (plugin.views.empty()) return {};
  const std::string names = joined(plugin.views);
  return plugin.kind == PluginKind::kMapper ? "Offers fields its: " + names + "."
                                            : "Needs a mapper that offers its: " + names + ".";
}

std::string reference_markdown(const std::vector<PluginInfo>& plugins,
                               const std::vector<SettingsBlock>& blocks) {
  std::ostringstream out;
  out << "# Parameters\n\nEvery plugin and every other block of a configuration, written by "
         "`sidestep plugins --markdown`.\n";
  for (const PluginInfo& plugin : plugins) {
    if (plugin.kind == PluginKind::kExperiment) continue;  // its block is one of `blocks`
    out << "\n## " << to_string(plugin.kind) << ": " << plugin.name << "\n\n"
        << plugin.doc << ".\n";
    if (const std::string views = views_sentence(plugin); !views.empty())
      out << '\n' << views << '\n';
    write_table(out, plugin.schema);
  }
  for (const SettingsBlock& block : blocks) {
    out << "\n## " << block.key << (block.type.empty() ? "" : ": " + block.type) << "\n\n"
        << block.doc << ".\n";
    write_table(out, block.schema);
  }
  return out.str();
}

std::string configuration_json_schema(const std::vector<PluginInfo>& plugins,
                                      const std::vector<SettingsBlock>& blocks) {
  Json properties = {{"schema_version", {{"const", 1}}}, {"base", Json::object()}};
  const auto add = [&](const std::string& key, const std::string& title, const std::string& doc,
                       const Schema& schema) -> Json& {
    Json block = schema_of_map(schema);
    block["title"] = title;
    block["description"] = doc;
    // A file with a base may leave out what the base says, even the plugin's name.
    block.erase("required");
    Json& alternatives = properties[key]["anyOf"];
    alternatives.push_back(std::move(block));
    return alternatives.back();
  };
  for (const PluginInfo& plugin : plugins) {
    if (plugin.kind == PluginKind::kCost)
      continue;  // no block of its own: a plan's `costs` name it
    if (plugin.kind == PluginKind::kExperiment) continue;  // its block is one of `blocks`
    Json& block = add(std::string(to_string(plugin.kind)), plugin.name, plugin.doc, plugin.schema);
    block["properties"]["plugin"] = {{"const", plugin.name}};
  }
  for (const SettingsBlock& settings : blocks) {
    Json& block = add(settings.key, settings.type.empty() ? settings.key : settings.type,
                      settings.doc, settings.schema);
    if (!settings.type.empty()) block["properties"]["type"] = {{"const", settings.type}};
  }
  if (properties.contains("source")) {
    properties["sources"] = {
        {"description", "Further sources of the same map, by name, beside `source`"},
        {"type", "object"},
        {"additionalProperties",
         {{"anyOf", Json::array({properties["source"], {{"type", "null"}}})}}}};
  }
  const Json schema = {{"$schema", "https://json-schema.org/draft/2020-12/schema"},
                       {"title", "Sidestep configuration"},
                       {"type", "object"},
                       {"properties", properties}};
  return schema.dump(2);
}

}  // namespace sidestep
