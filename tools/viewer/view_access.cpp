#include "view_access.hpp"

#include <arpa/inet.h>
#include <sys/random.h>

#include <algorithm>
#include <array>
#include <utility>

#include <sidestep/core/file.hpp>
#include <sidestep/core/format.hpp>
#include <sidestep/runtime/install_layout.hpp>

namespace sidestep {
namespace {

namespace fs = std::filesystem;

std::string content_type(const fs::path& file) {
  static constexpr std::array<std::pair<std::string_view, const char*>, 13> kTypes{{
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".mjs", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".json", "application/json"},
      {".map", "application/json"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".ico", "image/x-icon"},
      {".wasm", "application/wasm"},
      {".woff2", "font/woff2"},
      {".txt", "text/plain; charset=utf-8"},
      {".webmanifest", "application/manifest+json"},
  }};
  const std::string extension = file.extension().string();
  for (const auto& [name, type] : kTypes) {
    if (name == extension) return type;
  }
  return "application/octet-stream";
}

tl::unexpected<Error> not_readable(const fs::path& file, const std::string& why) {
  return fail(ErrorCode::kIo, "cannot read the viewer's page: " + why, file.string());
}

constexpr std::string_view kSocket = "/socket";

bool equal_ignoring_case(std::string_view a, std::string_view b) noexcept {
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; };
  return std::ranges::equal(a, b, {}, lower, lower);
}

bool is_ip_address(const std::string& host) noexcept {
  in6_addr address{};
  return inet_pton(AF_INET, host.c_str(), &address) == 1 ||
         inet_pton(AF_INET6, host.c_str(), &address) == 1;
}

bool is_loopback(const std::string& host) noexcept {
  return host.starts_with("127.") || host == "::1";
}

bool is_any_address(const std::string& host) noexcept { return host == "0.0.0.0" || host == "::"; }

/// The host's name without the port, and without an IPv6 address's brackets; nothing where the
/// port is another one.
std::optional<std::string> host_name(std::string_view host, unsigned short port) {
  const std::string suffix = ":" + std::to_string(port);
  if (host.ends_with(suffix)) {
    host.remove_suffix(suffix.size());
  } else if (port != 80) {
    return std::nullopt;
  }
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  return std::string(host);
}

/// A name that an attacker's DNS could make point here is none of ours.
bool is_own_name(std::string_view host, const ViewAddress& address) {
  const auto name = host_name(host, address.port);
  if (!name) return false;
  if (equal_ignoring_case(*name, address.host)) return true;
  if (is_any_address(address.host)) {
    return is_ip_address(*name) || equal_ignoring_case(*name, "localhost") ||
           (!address.machine.empty() && equal_ignoring_case(*name, address.machine));
  }
  return is_loopback(address.host) && equal_ignoring_case(*name, "localhost");
}

bool has_token(std::string_view query, const std::string& token) noexcept {
  constexpr std::string_view kName = "token=";
  while (!query.empty()) {
    const std::string_view field = query.substr(0, query.find('&'));
    if (field.starts_with(kName)) {
      return equal_in_constant_time(field.substr(kName.size()), token);
    }
    query.remove_prefix(std::min(query.size(), field.size() + 1));
  }
  return false;
}

bool is_own_origin(const ViewRequest& request) {
  if (!request.origin) return true;
  constexpr std::string_view kScheme = "http://";
  return request.origin->starts_with(kScheme) &&
         equal_ignoring_case(request.origin->substr(kScheme.size()), request.host);
}

}  // namespace

Result<ViewAssets> ViewAssets::read(const fs::path& folder, const std::string& page) {
  ViewAssets assets;
  std::error_code error;
  if (!fs::is_regular_file(folder / page, error)) {
    return fail(
        ErrorCode::kNotFound, "this build of Sidestep has no viewer's page", folder.string(),
        "install nodejs and npm (tools/install_deps.sh does), then configure and build again");
  }
  std::uintmax_t total = 0;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (!fs::is_regular_file(entry->symlink_status())) continue;
    const bool is_page = entry->path().extension() == ".html";
    if (is_page && entry->path() != folder / page) continue;
    total += entry->file_size();
    if (total > kMostBytes) return not_readable(folder, "the folder holds more than 64 MiB");
    auto bytes = read_file(entry->path(), kMostBytes);
    if (!bytes) return not_readable(entry->path(), bytes.error().message);
    const std::string path = "/" + entry->path().lexically_relative(folder).generic_string();
    assets.assets_[path] = {content_type(entry->path()), *std::move(bytes)};
  }
  if (error) return not_readable(folder, error.message());
  assets.assets_["/"] = assets.assets_["/" + page];
  return assets;
}

const ViewAsset* ViewAssets::find(std::string_view path) const {
  const auto found = assets_.find(path);
  return found == assets_.end() ? nullptr : &found->second;
}

fs::path view_assets_folder() { return install_layout().configs.parent_path() / "viewer"; }

std::string ViewAddress::url() const {
  const std::string& name = is_any_address(host) && !machine.empty() ? machine : host;
  const bool is_v6 = name.find(':') != std::string::npos;
  return "http://" + (is_v6 ? "[" + name + "]" : name) + ":" + std::to_string(port) + "/" +
         (token ? "?token=" + *token : "");
}

ViewAnswer answer(const ViewRequest& request, const ViewAddress& address,
                  const ViewAssets& assets) {
  if (!is_own_name(request.host, address)) return {403, nullptr, "This is not the host you mean."};
  if (request.method != "GET" && request.method != "HEAD") {
    return {405, nullptr, "Only GET and HEAD are answered."};
  }
  if (request.has_body) return {413, nullptr, "Requests have no body here."};
  const std::size_t mark = std::min(request.target.find('?'), request.target.size());
  const std::string_view path = request.target.substr(0, mark);
  const std::string_view query = request.target.substr(std::min(mark + 1, request.target.size()));
  const ViewAsset* const asset = assets.find(path);
  const bool is_socket = path == kSocket;
  if (asset == nullptr && !is_socket) return {404, nullptr, "There is no such file."};
  // What the page consists of is no secret; what it is told is.
  const bool needs_token = is_socket || path == "/" || path.ends_with(".html");
  if (needs_token && address.token && !has_token(query, *address.token)) {
    return {403, nullptr, "The token is missing or wrong: use the URL that Sidestep printed."};
  }
  if (!is_socket) return {200, asset, ""};
  if (!is_own_origin(request)) return {403, nullptr, "Other sites' pages are not served."};
  if (!request.is_upgrade) return {426, nullptr, "This is a WebSocket."};
  return {101, nullptr, ""};
}

bool equal_in_constant_time(std::string_view a, std::string_view b) noexcept {
  if (a.size() != b.size()) return false;
  unsigned char differences = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    differences = static_cast<unsigned char>(differences | (a[i] ^ b[i]));
  }
  return differences == 0;
}

Result<std::string> random_token() {
  std::array<unsigned char, 16> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    return fail(ErrorCode::kInternal, "the system has no random numbers for the viewer's token");
  }
  std::string token;
  for (const unsigned char byte : bytes) token += format("%02x", byte);
  return token;
}

}  // namespace sidestep
