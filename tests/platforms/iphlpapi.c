/* No network interface but the local one, for the JVM in Wine 8, whose own DLL lacks GetAnycastIpAddressTable. For tests only:
   it lies beside java.exe.
   x86_64-w64-mingw32-gcc -shared -O2 -o iphlpapi.dll iphlpapi.c */
#include <stdlib.h>

#define EXPORT __declspec(dllexport)
#define NO_ERROR 0u
#define ERROR_FILE_NOT_FOUND 2u
#define ERROR_NOT_SUPPORTED 50u

/* An empty table of any of the three kinds: a count, and room for one row. */
static unsigned empty(void **table)
{
    *table = calloc(1, 4096);
    return NO_ERROR;
}

EXPORT unsigned GetIfTable2(void **table) { return empty(table); }
EXPORT unsigned GetUnicastIpAddressTable(unsigned family, void **table) { (void)family; return empty(table); }
EXPORT unsigned GetAnycastIpAddressTable(unsigned family, void **table) { (void)family; return empty(table); }
EXPORT void FreeMibTable(void *table) { free(table); }
EXPORT unsigned GetIfEntry2(void *row) { (void)row; return ERROR_FILE_NOT_FOUND; }
EXPORT unsigned ConvertInterfaceNameToLuidW(void *name, void *luid) { (void)name; (void)luid; return ERROR_FILE_NOT_FOUND; }
EXPORT unsigned ConvertInterfaceLuidToNameW(void *luid, void *name, size_t length)
{
    (void)luid; (void)name; (void)length;
    return ERROR_FILE_NOT_FOUND;
}
EXPORT unsigned GetAdaptersAddresses(unsigned family, unsigned flags, void *reserved, void *addresses, unsigned *size)
{
    (void)family; (void)flags; (void)reserved; (void)addresses; (void)size;
    return ERROR_NOT_SUPPORTED;
}
EXPORT unsigned NotifyAddrChange(void **handle, void *overlapped) { (void)handle; (void)overlapped; return ERROR_NOT_SUPPORTED; }
