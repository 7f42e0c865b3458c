package tickbus.petri.page;

import java.util.ArrayDeque;
import java.util.Deque;
import java.util.HashMap;
import java.util.Iterator;
import java.util.Map;
import java.util.concurrent.Executor;

/**
 * The threads of a page. A thread that reads or writes for too long (a browser that sleeps, a client that never ends its
 * request) is interrupted, which closes its connection.
 */
final class Workers implements Executor, AutoCloseable {
    private final int most;
    private final long patienceNanos;
    private final Deque<Runnable> waiting = new ArrayDeque<>();
    /** Since when each thread has been reading or writing. */
    private final Map<Thread, Long> busy = new HashMap<>();
    private int threads;
    private int idle;
    private boolean closed;

    /** Limits the number of threads, and the time for which each may read or write. */
    Workers(int most, long patienceNanos) {
        this.most = most;
        this.patienceNanos = patienceNanos;
    }

    @Override
    public synchronized void execute(Runnable task) {
        waiting.add(task);
        if (idle >= waiting.size()) {
            notifyAll();
        } else if (threads < most) {
            threads++;
            start(this::work, "net page " + threads);
        }
    }

    static Thread start(Runnable task, String name) {
        Thread thread = new Thread(task, name);
        thread.setDaemon(true);
        thread.start();
        return thread;
    }

    private void work() {
        for (Runnable task = next(); task != null; task = next()) {
            try {
                busy();
                task.run();
            } catch (RuntimeException unexpected) {
                // The server has closed the connection; the next one needs this thread.
            } finally {
                free();
            }
        }
    }

    private synchronized Runnable next() {
        idle++;
        while (waiting.isEmpty() && !closed) {
            try {
                wait();
            } catch (InterruptedException e) {
                // The previous task took too long, and is over.
            }
        }
        idle--;
        return closed ? null : waiting.poll();
    }

    /** This thread begins to read or to write. */
    synchronized void busy() {
        busy.put(Thread.currentThread(), System.nanoTime());
    }

    /** This thread has finished reading or writing. An earlier interrupt does not count any more. */
    synchronized void free() {
        busy.remove(Thread.currentThread());
        Thread.interrupted();
    }

    /** Interrupts threads that read or write for too long. */
    synchronized void look() {
        long now = System.nanoTime();
        for (Iterator<Map.Entry<Thread, Long>> each = busy.entrySet().iterator(); each.hasNext();) {
            Map.Entry<Thread, Long> one = each.next();
            if (now - one.getValue() > patienceNanos) {
                one.getKey().interrupt();
                each.remove();
            }
        }
    }

    @Override
    public synchronized void close() {
        closed = true;
        busy.keySet().forEach(Thread::interrupt);
        notifyAll();
    }
}
