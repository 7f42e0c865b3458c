/* Sends back what a client sends: what a connection costs without any protocol. Prints the port on which it listens. */
#ifdef _WIN32
#include <winsock2.h>
#include <ws2tcpip.h>
#else
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#endif
#include <stdio.h>

int main(void) {
    struct sockaddr_in address = {.sin_family = AF_INET};
    socklen_t length = sizeof address;
    int immediately = 1;
    char bytes[4096];
#ifdef _WIN32
    WSADATA data;
    if (WSAStartup(MAKEWORD(2, 2), &data) != 0) {
        return 1;
    }
#endif
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int listener = (int)socket(AF_INET, SOCK_STREAM, 0);
    if (bind(listener, (struct sockaddr *)&address, sizeof address) != 0 || listen(listener, 1) != 0 ||
        getsockname(listener, (struct sockaddr *)&address, &length) != 0) {
        return 1;
    }
    printf("listening on 127.0.0.1:%d\n", ntohs(address.sin_port));
    fflush(stdout);
    int client = (int)accept(listener, NULL, NULL);
    setsockopt(client, IPPROTO_TCP, TCP_NODELAY, (const char *)&immediately, sizeof immediately);
    for (;;) {
        int count = (int)recv(client, bytes, sizeof bytes, 0);
        if (count <= 0 || send(client, bytes, count, 0) != count) {
            return 0;
        }
    }
}
