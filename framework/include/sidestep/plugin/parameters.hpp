#pragma once

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/node.hpp>
#include <sidestep/plugin/schema.hpp>

namespace sidestep {

/// What may be said of a parameter beyond its name, type and doc.
struct ParameterOptions {
  std::string unit = {};
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool required = false;
  std::vector<std::string> choices = {};  ///< For a std::string: one of these.
  /// For a Node: it is a block `{plugin: NAME, ...}` of this kind. The host checks it and fills in
  /// its defaults, but for the parameters that its owner sets.
  std::optional<PluginKind> plugin = std::nullopt;
  std::vector<std::string> set_by_owner = {};
};

namespace detail {

/// How a C++ type is declared, written and read. Supported: bool, int, std::int64_t, double,
/// std::string, std::filesystem::path, std::vector of double, int or std::string,
/// Eigen::Vector3d, Eigen::Vector3i, Node, structs with parameters(), vectors of those, and
/// std::optional of any of them but std::vector.
template <class V>
struct ParameterTraits;

}  // namespace detail

/// The one declaration of the parameters of a struct T: names, units, ranges, docs; types and
/// defaults come from T's members and their initialisers.
template <class T>
class Parameters {
 public:
  /// `member`: of T, or of what it derives from.
  template <class V, class Base>
  Parameters&& add(std::string name, V Base::*member, std::string doc,
                   ParameterOptions options = {}) && {
    insert(std::move(name), static_cast<V T::*>(member), std::move(doc), std::move(options));
    return std::move(*this);
  }

  [[nodiscard]] const Schema& schema() const noexcept { return schema_; }

  /// Reads the keys of a checked map into `into`; what is absent keeps its value.
  void read(const Node& map, T& into, std::vector<Error>& errors) const {
    for (const auto& reader : readers_) reader(map, into, errors);
  }

 private:
  template <class V>
  void insert(std::string name, V T::*member, std::string doc, ParameterOptions options) {
    using Type = detail::ParameterTraits<V>;
    const T defaults{};
    Parameter parameter;
    parameter.name = name;
    parameter.type = options.choices.empty() ? Type::kType : ParameterType::kChoice;
    parameter.unit = std::move(options.unit);
    parameter.doc = std::move(doc);
    parameter.required = options.required;
    parameter.min = options.min;
    parameter.max = options.max;
    parameter.choices = std::move(options.choices);
    if (!parameter.required) parameter.default_text = Type::text(defaults.*member);
    parameter.size = Type::kSize;
    parameter.parameters = Type::parameters();
    parameter.plugin = options.plugin;
    parameter.set_by_owner = std::move(options.set_by_owner);
    schema_.push_back(std::move(parameter));
    readers_.push_back(
        [name = std::move(name), member](const Node& map, T& into, std::vector<Error>& errors) {
          const Node* node = map.find(name);
          if (node == nullptr || node->is_null()) return;
          Type::read(*node, into.*member, errors);
        });
  }

  Schema schema_;
  std::vector<std::function<void(const Node&, T&, std::vector<Error>&)>> readers_;
};

namespace detail {

template <class V>
void assign(Result<V> value, V& into, std::vector<Error>& errors) {
  if (value) {
    into = std::move(*value);
  } else {
    errors.push_back(std::move(value.error()));
  }
}

/// The shortest decimal that reads back as the same number.
[[nodiscard]] std::string number_text(double value);

struct ScalarField {
  static constexpr std::optional<std::size_t> kSize = std::nullopt;
  static std::vector<Parameter> parameters() { return {}; }
};

template <>
struct ParameterTraits<bool> : ScalarField {
  static constexpr ParameterType kType = ParameterType::kBool;
  static std::string text(bool value) { return value ? "true" : "false"; }
  static void read(const Node& node, bool& into, std::vector<Error>& errors) {
    assign(node.as_bool(), into, errors);
  }
};

template <class I>
requires(std::is_same_v<I, int> || std::is_same_v<I, std::int64_t>) struct ParameterTraits<I>
    : ScalarField {
  static constexpr ParameterType kType = ParameterType::kInt;
  static std::string text(I value) { return std::to_string(value); }
  static void read(const Node& node, I& into, std::vector<Error>& errors) {
    auto value = node.as_int();
    if (value && !std::in_range<I>(*value)) {
      errors.push_back(node.error("the number is too large"));
    } else if (value) {
      into = static_cast<I>(*value);
    } else {
      errors.push_back(std::move(value.error()));
    }
  }
};

template <>
struct ParameterTraits<double> : ScalarField {
  static constexpr ParameterType kType = ParameterType::kDouble;
  static std::string text(double value) { return number_text(value); }
  static void read(const Node& node, double& into, std::vector<Error>& errors) {
    assign(node.as_double(), into, errors);
  }
};

template <>
struct ParameterTraits<std::string> : ScalarField {
  static constexpr ParameterType kType = ParameterType::kString;
  static std::string text(const std::string& value) { return value.empty() ? "\"\"" : value; }
  static void read(const Node& node, std::string& into, std::vector<Error>& errors) {
    assign(node.as_string(), into, errors);
  }
};

template <>
struct ParameterTraits<std::filesystem::path> : ScalarField {
  static constexpr ParameterType kType = ParameterType::kPath;
  static std::string text(const std::filesystem::path& value) {
    return value.empty() ? "\"\"" : value.string();
  }
  static void read(const Node& node, std::filesystem::path& into, std::vector<Error>& errors) {
    assign(node.as_path(), into, errors);
  }
};

template <>
struct ParameterTraits<Node> : ScalarField {
  static constexpr ParameterType kType = ParameterType::kNode;
  static std::string text(const Node&) { return "null"; }
  static void read(const Node& node, Node& into, std::vector<Error>&) { into = node; }
};

template <class V>
struct ParameterTraits<std::optional<V>> {
  static constexpr ParameterType kType = ParameterTraits<V>::kType;
  static constexpr std::optional<std::size_t> kSize = ParameterTraits<V>::kSize;
  static std::vector<Parameter> parameters() { return ParameterTraits<V>::parameters(); }
  static std::string text(const std::optional<V>& value) {
    return value ? ParameterTraits<V>::text(*value) : "null";
  }
  static void read(const Node& node, std::optional<V>& into, std::vector<Error>& errors) {
    V value{};
    const std::size_t before = errors.size();
    ParameterTraits<V>::read(node, value, errors);
    if (errors.size() == before) into = std::move(value);
  }
};

/// A struct with parameters of its own.
template <class V>
requires requires { V::parameters(); }
struct ParameterTraits<V> {
  static constexpr ParameterType kType = ParameterType::kObject;
  static constexpr std::optional<std::size_t> kSize = std::nullopt;
  static std::vector<Parameter> parameters() { return V::parameters().schema(); }
  static std::string text(const V&) { return "{}"; }
  static void read(const Node& node, V& into, std::vector<Error>& errors) {
    V::parameters().read(node, into, errors);
  }
};

template <class V>
constexpr ParameterType list_type() {
  if constexpr (ParameterTraits<V>::kType == ParameterType::kDouble)
    return ParameterType::kDoubles;
  else if constexpr (ParameterTraits<V>::kType == ParameterType::kInt)
    return ParameterType::kInts;
  else if constexpr (ParameterTraits<V>::kType == ParameterType::kString)
    return ParameterType::kStrings;
  else
    return ParameterType::kObjects;
}

template <class V>
struct ParameterTraits<std::vector<V>> {
  static constexpr ParameterType kType = list_type<V>();
  static constexpr std::optional<std::size_t> kSize = std::nullopt;
  static std::vector<Parameter> parameters() { return ParameterTraits<V>::parameters(); }
  static std::string text(const std::vector<V>& values) {
    std::string out = "[";
    for (const V& value : values) {
      if (out.size() > 1) out += ", ";
      out += ParameterTraits<V>::text(value);
    }
    return out + "]";
  }
  static void read(const Node& node, std::vector<V>& into, std::vector<Error>& errors) {
    into.clear();
    for (const Node& item : node.items()) {
      into.emplace_back();
      ParameterTraits<V>::read(item, into.back(), errors);
    }
  }
};

template <class S>
struct ParameterTraits<Eigen::Matrix<S, 3, 1>> {
  static constexpr ParameterType kType = list_type<S>();
  static constexpr std::optional<std::size_t> kSize = 3;
  static std::vector<Parameter> parameters() { return {}; }
  static std::string text(const Eigen::Matrix<S, 3, 1>& value) {
    return ParameterTraits<std::vector<S>>::text({value.x(), value.y(), value.z()});
  }
  static void read(const Node& node, Eigen::Matrix<S, 3, 1>& into, std::vector<Error>& errors) {
    std::vector<S> values;
    ParameterTraits<std::vector<S>>::read(node, values, errors);
    if (values.size() == 3) {
      into = Eigen::Matrix<S, 3, 1>(values[0], values[1], values[2]);
    } else {
      errors.push_back(node.error("expected a list of 3 numbers"));
    }
  }
};

}  // namespace detail
}  // namespace sidestep
