/* thread.h: a thread and a lock, for POSIX and for Windows. */
#ifndef BRICKPILOT_RUN_THREAD_H
#define BRICKPILOT_RUN_THREAD_H

#ifdef _WIN32

#include <windows.h>

typedef HANDLE thread_t;
typedef SRWLOCK lock_t;

#define LOCK_FREE SRWLOCK_INIT /* the value of a lock that nobody holds */
#define THREAD_RETURNS DWORD WINAPI
#define THREAD_DONE 0

/* Starts a thread that calls `run` with `argument`. Returns 0, or another value if no thread can be started. */
static inline int thread_start(thread_t *thread, LPTHREAD_START_ROUTINE run, void *argument)
{
    *thread = CreateThread(NULL, 0, run, argument, 0, NULL);
    return *thread == NULL;
}

static inline void thread_join(thread_t thread)
{
    WaitForSingleObject(thread, INFINITE);
    CloseHandle(thread);
}

static inline void lock_take(lock_t *lock)
{
    AcquireSRWLockExclusive(lock);
}
static inline void lock_give(lock_t *lock)
{
    ReleaseSRWLockExclusive(lock);
}

#else

#include <pthread.h>
#include <stddef.h>

typedef pthread_t thread_t;
typedef pthread_mutex_t lock_t;

#define LOCK_FREE PTHREAD_MUTEX_INITIALIZER
#define THREAD_RETURNS void *
#define THREAD_DONE NULL

static inline int thread_start(thread_t *thread, void *(*run)(void *), void *argument)
{
    return pthread_create(thread, NULL, run, argument);
}

static inline void thread_join(thread_t thread)
{
    pthread_join(thread, NULL);
}
static inline void lock_take(lock_t *lock)
{
    pthread_mutex_lock(lock);
}
static inline void lock_give(lock_t *lock)
{
    pthread_mutex_unlock(lock);
}

#endif

#endif
