#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <memory>

#include "fuzzing.hpp"
#include "support/temporary_folder.hpp"
#include "view_server.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

namespace {

std::unique_ptr<ViewServer> server_of_a_page() {
  const testing_support::TemporaryFolder folder;
  (void)folder.write("index.html", "<p>the page</p>");
  auto assets = ViewAssets::read(folder.path());
  require(assets.has_value(), "there is a page");
  ViewServerSettings settings;
  settings.require_token = false;
  auto server = ViewServer::start(std::move(*assets), settings);
  require(server.has_value(), "there is a server");
  return std::move(*server);
}

}  // namespace

// What one connection sends to the viewer's server before it hears no more: a request, and what
// follows it. The port that a request names stands as "PORT" in it.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::unique_ptr<ViewServer> kServer = server_of_a_page();
  const unsigned short port = kServer->address().port;
  std::string request = text_of(data, size);
  for (std::size_t at = 0; (at = request.find("PORT", at)) != std::string::npos;) {
    request.replace(at, 4, std::to_string(port));
  }
  const int connection = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  require(connect(connection, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0,
          "the server answers");
  const timeval limit{20, 0};
  setsockopt(connection, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  (void)send(connection, request.data(), request.size(), MSG_NOSIGNAL);
  shutdown(connection, SHUT_WR);
  std::array<char, 4096> answer{};
  ssize_t got = 0;
  while ((got = recv(connection, answer.data(), answer.size(), 0)) > 0) continue;
  require(got == 0 || errno != EAGAIN, "the server ends the connection");
  close(connection);
  return 0;
}
